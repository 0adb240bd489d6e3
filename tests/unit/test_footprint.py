"""The robot's footprint: passages a disc on the ground cannot take are closed, at their own width in every image."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rendered import segment_view

import ffseg
from ffseg.batch.views import load_views
from ffseg.camera.model import Camera
from ffseg.camera.projections import Affine, UnifiedSphere
from ffseg.errors import SegmentationError
from ffseg.geometry.ragged import packed
from ffseg.methods.freeform import native_options
from ffseg.native import _core
from ffseg.rendering.pairs import CAMERA_YAML, sample_camera

RADIUS = 0.15
PARAMS = ffseg.load_params()


def painted(camera: Camera, dark: np.ndarray) -> np.ndarray:
    """An image of a grey floor with a little noise, dark where the ground is."""
    grey = np.where(dark, 40.0, 110.0) + np.random.default_rng(3).normal(0, 1.0, dark.shape)
    grey[~camera.domain()] = 4.0
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def ring_wall(camera: Camera, distance: float, gap: float) -> np.ndarray:
    """A wall round the camera, 0.12 m thick, with one gap so many metres wide, toward x."""
    x, y = np.moveaxis(camera.ground(), -1, 0)
    reach = np.hypot(x, y)
    with np.errstate(invalid="ignore"):
        return (reach > distance) & (reach < distance + 0.12) & ~((np.abs(y) < gap / 2) & (x > 0))


def beyond(camera: Camera, distance: float) -> np.ndarray:
    reach = np.hypot(*np.moveaxis(camera.ground(), -1, 0))
    with np.errstate(invalid="ignore"):
        return (reach > distance + 0.4) & (reach < distance + 0.8)


@pytest.mark.parametrize("distance", [0.8, 1.4, 2.2])
@pytest.mark.parametrize(("gap", "passes"), [(0.24, False), (0.38, True)])
def test_a_passage_is_as_wide_as_it_is_on_the_ground(distance: float, gap: float, passes: bool) -> None:
    """0.30 m is what the robot needs, 58 px near and 26 px far; half a wall's edge at either side is not free."""
    camera = replace(sample_camera(), footprint=RADIUS)
    image = painted(camera, ring_wall(camera, distance, gap))
    free = segment_view(image, camera, PARAMS).mask[beyond(camera, distance)].mean()
    assert free > 0.99 if passes else free == 0.0
    assert segment_view(image, replace(camera, footprint=0.0), PARAMS).mask[beyond(camera, distance)].mean() > 0.99


def pinhole() -> Camera:
    """A perspective camera 0.9 m high that looks 30 degrees down, its horizon in the image."""
    lens = UnifiedSphere(Affine(300.0, 300.0, 319.5, 239.5), 0.0, (0.0, 0.0, 0.0, 0.0))
    down = np.deg2rad(30.0)
    up = np.array([0.0, -np.cos(down), -np.sin(down)])
    return Camera(lens, 640, 480, (319.5, 239.5), mount_height=0.9, up=up, mirrored=False, forward=-90.0)


def test_nothing_above_the_horizon_is_free() -> None:
    horizon = 239.5 - 300.0 * np.tan(np.deg2rad(30.0))  # rows above it look upward
    mask = segment_view(np.full((480, 640), 110, np.uint8), pinhole(), PARAMS).mask  # no edge at the horizon
    assert not mask[: int(np.floor(horizon)) + 1].any()
    assert mask[int(np.ceil(horizon)) + 3 :].mean() > 0.99


@pytest.mark.parametrize(("gap", "passes"), [(0.24, False), (0.38, True)])
def test_a_perspective_camera_over_a_plane(gap: float, passes: bool) -> None:
    camera = replace(pinhole(), footprint=RADIUS)
    x, y = np.moveaxis(camera.ground(), -1, 0)
    with np.errstate(invalid="ignore"):
        wall = (-y > 2.4) & (-y < 2.5) & ~(np.abs(x) < gap / 2)
        past = (-y > 3.0) & (-y < 4.0) & (np.abs(x) < 0.8)
    free = segment_view(painted(camera, wall), camera, PARAMS).mask[past].mean()
    assert free > 0.98 if passes else free == 0.0


@pytest.mark.parametrize("radius", [0.02, 0.0005])
def test_a_small_robot_goes_as_far_as_any(radius: float) -> None:
    """Its map of the ground ended at 128 radii, and so did the free space."""
    camera = replace(sample_camera(), footprint=radius)
    image = painted(camera, ring_wall(camera, 4.0, 0.0))
    whole = segment_view(image, replace(camera, footprint=0.0), PARAMS).mask
    assert (segment_view(image, camera, PARAMS).mask & whole).sum() > 0.995 * whole.sum()


def test_bays_that_half_the_robot_cannot_enter_are_closed() -> None:
    """As squares of a box that have the floor's grey; a bay wider than half of it stays open, and one wider than the robot."""
    camera = replace(sample_camera(), footprint=RADIUS)
    x, y = np.moveaxis(camera.ground(), -1, 0)
    with np.errstate(invalid="ignore"):
        block = (x > 1.0) & (x < 1.6) & (np.abs(y) < 0.8)
        narrow = block & (np.abs(y - 0.5) < 0.05) & (x < 1.4)
        wide = block & (np.abs(y + 0.3) < 0.2) & (x < 1.4)
        between = block & (np.abs(y - 0.2) < 0.11) & (x < 1.4)
    mask = segment_view(painted(camera, block & ~narrow & ~wide & ~between), camera, PARAMS).mask
    assert mask[narrow & (x > 1.1)].mean() < 0.05
    assert mask[wide & (x < 1.35)].mean() > 0.95
    assert mask[between & (x < 1.35)].mean() > 0.95


def test_a_footprint_that_fits_nowhere_says_so() -> None:
    camera = replace(sample_camera(), footprint=0.6)
    image = painted(camera, ring_wall(camera, 0.6, 0.0))
    said = r"^the start .* cannot move .*; .* the footprint of 0\.6 m: give a smaller one"
    with pytest.raises(SegmentationError, match=said):
        segment_view(image, camera, PARAMS)


def test_a_start_round_the_robots_disc_is_not_moved_into_it() -> None:
    """The disc of 20 px is empty, and walls stand round it: nothing is free there, nor is what lies behind them."""
    camera = replace(sample_camera(), robot_radius=20.0)
    x, y = np.meshgrid(np.arange(camera.width) - camera.center[0], np.arange(camera.height) - camera.center[1])
    image = np.where(np.abs(np.hypot(x, y) - 40.0) < 5.0, np.uint8(30), np.uint8(120))
    said = "every sample and cannot move from round the robot's disc, of radius 20; "
    with pytest.raises(SegmentationError, match=said):
        segment_view(image, camera, ffseg.load_params("omni-indoor"))


def test_the_camera_file_says_it_and_the_option_overrules(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text(CAMERA_YAML + "footprint: 0.2\nmirrored: false\nforward: -90\n")
    camera = ffseg.load_camera(tmp_path / "camera.yaml")
    assert (camera.footprint, camera.mirrored, camera.forward) == (0.2, False, -90.0)
    for option, taken in ((0.1, 0.1), (None, 0.2)):
        assert load_views(str(tmp_path / "camera.yaml"), None, None, [], option).camera.footprint == taken


def test_the_core_refuses_a_plane_that_does_not_fit() -> None:
    options = native_options(ffseg.load_params(None, {"contour.degree": 1}), 2.0)
    given = (*packed((ffseg.FreeForm.box(4, 4, 12, 12),)), np.zeros((16, 16), np.uint8), None, options, None)
    with pytest.raises(ValueError, match="arrays differ in size"):
        _core.Evolution(*given, np.zeros((16, 15), np.int32))
    with pytest.raises(ValueError, match="4096 cells"):
        _core.Evolution(*given, np.full((16, 16), 4096, np.int32))
