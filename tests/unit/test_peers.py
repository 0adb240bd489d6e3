"""Peers: each installed one finds a plain disc; those that are not installed say so."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ffseg.api import segment
from ffseg.errors import ParameterError, SegmentationError
from ffseg.image.opencv_peers import connected, dilated_by_disc
from ffseg.image.raster import rasterize
from ffseg.methods import peers
from ffseg.metrics import scores
from ffseg.parameter_files import load_params
from ffseg.peer_parameters import PeerParameters, SkimageGac, load_peer_parameters
from ffseg.plugins import METHODS, PEERS
from ffseg.result import Segmentation
from ffseg.schema.kinds import Integer, Number
from ffseg.schema.sections import leaves
from tests.discs import bright_disc, disc_of

SHAPE = (120, 160)
PARAMS = load_params(None, {"init.center": [80, 60], "init.radius": 12})
FLOOR = {"skimage_snake": 0.9, "cv_grabcut": 0.97, "cv_watershed": 0.97}
"""What a peer reaches on a disc of radius 40; 0.98 is a mean distance of 0.4 px."""


def disc() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    inside = disc_of(SHAPE)(80.2, 59.7, 40.3)
    return bright_disc(SHAPE, (80.2, 59.7), 40.3), inside.astype(np.uint8) * np.uint8(255)


def segment_peer(
    image: np.ndarray, name: str, options: PeerParameters | None = None, domain: np.ndarray | None = None
) -> Segmentation:
    params, section = peers.method_parameters(PARAMS, name, options)
    return segment(image, params, name, options=section, domain=domain)


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the packages
def test_a_peer_finds_a_disc(name: str) -> None:
    if not PEERS[name].installed:
        pytest.skip(f"{PEERS[name].package} is not installed")
    image, truth = disc()
    result = segment_peer(image, name, replace(PeerParameters(), skimage_gac=SkimageGac(iterations=60)))
    assert scores(result.mask, truth).iou >= FLOOR.get(name, 0.98)
    assert (rasterize(result.contours, SHAPE) == result.mask).all()
    assert result.timings.evolve_ms > 0
    assert (result.timings.edges_ms > 0) == PEERS[name].uses_edges


def test_colour_images_work_too() -> None:
    image, truth = disc()
    colour = np.stack([image, 255 - image, image], axis=2)
    for name in ("cv_floodfill", "cv_edges", "cv_edges_opened", "cv_watershed", "cv_grabcut"):
        found = segment_peer(colour, name)
        assert scores(found.mask, truth).iou >= FLOOR.get(name, 0.98)


def test_a_peer_is_a_method() -> None:
    image, truth = disc()
    assert scores(segment(image, PARAMS, "cv_edges").mask, truth).iou >= 0.98
    with pytest.raises(ParameterError, match="cv_edges"):
        segment(image, PARAMS, "no_such_method")


def test_peers_stay_in_the_domain() -> None:
    image, _ = disc()
    domain = np.zeros(SHAPE, np.uint8)
    domain[:, :90] = 255
    for name in ("cv_floodfill", "cv_edges", "cv_edges_opened"):
        assert not segment_peer(image, name, domain=domain).mask[:, 90:].any()


def test_opened_components_do_not_leak_through_a_gap() -> None:
    image, truth = disc()
    image[58:62, 112:135] = 180  # a passage of 4 px through the edge into a bright corridor
    image[40:80, 130:158] = 180
    plain, opened = (segment_peer(image, name) for name in ("cv_edges", "cv_edges_opened"))
    assert scores(opened.mask, truth).iou > 0.97
    assert plain.mask[60, 145] or scores(plain.mask, truth).iou > 0.97


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.5, 3.0, 8.0, 9.0])
def test_a_region_grows_by_a_distance(radius: float) -> None:
    mask = np.random.default_rng(3).random((40, 50)) < 0.004
    rows, columns = np.nonzero(mask)
    y, x = np.mgrid[:40, :50]
    near = np.min((y[..., None] - rows) ** 2 + (x[..., None] - columns) ** 2, axis=2) <= radius**2
    assert np.array_equal(dilated_by_disc(mask, radius), near)


def test_all_seeds_are_followed() -> None:
    free = np.ones((20, 30), np.bool_)
    free[:, [10, 20]] = False
    seeds = np.zeros_like(free)
    seeds[5, [3, 10, 25]] = True
    expected = free.copy()
    expected[:, 11:20] = False
    assert np.array_equal(connected(free, seeds), expected)


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(METHODS, "skfmm", replace(METHODS["skfmm"], module="no_such_module"))
    with pytest.raises(SegmentationError, match="scikit-fmm"):
        segment_peer(disc()[0], "skfmm")


def test_every_peer_has_its_parameters() -> None:
    assert PeerParameters.__dataclass_fields__.keys() - {"shared_edges"} == set(PEERS)


def test_a_peer_file_is_read_strictly(tmp_path: Path) -> None:
    good, bad = tmp_path / "good.yaml", tmp_path / "bad.yaml"
    good.write_text("cv_edges:\n  threshold: 12\n", encoding="utf-8")
    bad.write_text("cv_edges:\n  treshold: 12\n", encoding="utf-8")
    assert load_peer_parameters(good).cv_edges.threshold == 12.0
    with pytest.raises(ParameterError, match=r"bad\.yaml:2.*cv_edges\.threshold"):
        load_peer_parameters(bad)


def test_peers_can_share_one_edge_map() -> None:
    edges = PARAMS.edges
    own, shared = PeerParameters(), PeerParameters(shared_edges=True)
    assert peers.edge_parameters("cv_edges", edges, own).sigma == own.cv_edges.sigma
    assert peers.edge_parameters("cv_edges", edges, shared) == edges
    assert peers.edge_parameters("cv_floodfill", edges, own) == edges


def test_grabcut_says_that_a_start_leaves_nothing_outside() -> None:
    """It was the assertion of OpenCV, with the place in its source."""
    with pytest.raises(SegmentationError, match="the start leaves no pixel outside to learn from; change init.radius"):
        segment(disc()[0], load_params(None, {"init.radius": 1000}), "cv_grabcut")


def at_their_limits() -> list[tuple[str, dict[str, float]]]:
    """Every number of the peers' parameters at its limits, and as near to zero as it may be, with few iterations."""
    kinds = {key: leaf.kind for key, leaf in leaves(PeerParameters).items() if isinstance(leaf.kind, Integer | Number)}
    cases = []
    for name, kind in kinds.items():
        peer, key = name.split(".")
        few = {"iterations": 2} if f"{peer}.iterations" in kinds and key != "iterations" else {}
        values = {kind.low, kind.high, 1e-300} if key != "iterations" else {kind.low}
        cases += [(peer, {**few, key: value}) for value in values]
    return cases


@pytest.mark.parametrize("name", [name for name in PEERS if METHODS[name].installed])
def test_parameters_at_their_limits_give_a_region_or_a_sentence(name: str, tmp_path: Path) -> None:
    """100,000 points of scikit-image's snake asked for 75 GB."""
    image = disc()[0][20:100:2, 20:140:2].copy()
    params = load_params(None, {"init.radius": 6})
    for values in (values for peer, values in at_their_limits() if peer == name):
        (tmp_path / "peers.yaml").write_text(json.dumps({name: values}))
        try:
            own, options = peers.method_parameters(params, name, load_peer_parameters(tmp_path / "peers.yaml"))
            result = segment(image, own, name, options=options)
        except (ParameterError, SegmentationError):
            continue
        assert result.mask.shape == image.shape, values
