"""What the pages say of the samples and of the peers, measured."""

import re
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import ffseg
from ffseg.image.opencv_peers import near_start
from ffseg.image.raster import rasterize
from tests.discs import overlap as iou
from tests.masks import read_mask

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


@lru_cache(maxsize=8)
def overlap(name: str, **settings: object) -> float:
    """IoU of a sample with its truth; keys have ``__`` for the point."""
    image = ffseg.read_image(ROOT / "samples" / f"{name}.png")
    truth = read_mask(ROOT / "samples" / "truth" / f"{name}.png")
    mask = ffseg.segment(image, {key.replace("__", "."): value for key, value in settings.items()}).mask
    return iou(mask, truth)


def said(page: str, pattern: str) -> str:
    found = re.search(pattern, " ".join((DOCS / page).read_text("utf-8").split()))
    assert found, f"{page} no longer says {pattern}"
    return found[1]


def test_smoothing_of_8_px_rounds_and_of_12_px_loses_the_bounds() -> None:
    claim = float(said("choosing-parameters.md", r"with rounded corners \(IoU ([\d.]+)\); at 12 px"))
    own = {"edges__source": "gradient"}
    assert overlap("complex", edges__sigma=8, **own) == pytest.approx(claim, abs=0.0005)  # three digits are printed
    assert overlap("complex", edges__sigma=12, **own) < 0.6
    image = ffseg.read_image(ROOT / "samples" / "complex.png")
    assert ffseg.segment(image, {"edges.sigma": 8}).source == "prior"


def test_the_pair_of_the_tutorial() -> None:
    pair = ROOT / "samples" / "pair"
    names = ["0001.png", "0002.png"]
    camera = ffseg.load_camera(pair / "camera.yaml")
    poses = ffseg.load_poses(pair / "poses.csv", names, camera)
    sequence = ffseg.Sequence(camera)
    first, second = (sequence.feed(ffseg.read_image(pair / name), poses[name]) for name in names)
    assert {component.verdict for component in first.components} == {"untested"}
    assert sorted(component.verdict for component in second.components) == ["false_obstacle"] * 3 + ["obstacle"] * 2
    claim = float(said("tutorial.md", r"given back \(IoU ([\d.]+)\)"))
    assert iou(second.mask, read_mask(pair / "truth" / "0002.png")) == pytest.approx(claim, abs=0.0005)


def test_grabcut_is_told_that_four_radii_round_the_start_are_probably_inside() -> None:
    radii = float(said("compare.md", r"`iterations=5 probable=(\d+)`"))
    disc = rasterize((ffseg.FreeForm.circle((150, 120), 20, 24, 3),), (240, 300))
    yy, xx = np.mgrid[:240, :300]
    distance = np.hypot(xx - 150, yy - 120)
    told = near_start(disc, radii)
    assert told[distance < 20 * radii - 1.5].all()
    assert not told[distance > 20 * radii + 1.5].any()  # a pixel for the disc's own steps, half for the centre


@pytest.mark.parametrize("name", ["simple", "complex"])
def test_table_1_is_what_the_methods_give(name: str) -> None:
    table = said("method.md", rf"\| {name} \|(.*?)(?:\| complex \||Its 240 iterations)")
    rows = re.findall(r"(\d+) \| (\d+) \| (\d+) \| [\d.]+ \| [\d.]+ \| (\d+)", table)
    image = ffseg.read_image(ROOT / "samples" / f"{name}.png")
    for row, method in zip(rows, ("snake", "levelset", "freeform", "paper"), strict=True):
        result = ffseg.segment(image, {"method": method, "edges.source": "gradient"})
        found = (result.stats.initial_points, result.stats.final_points, result.stats.iterations, result.num_holes)
        assert tuple(map(int, row)) == found, method
