"""Negative seeds: rivals grow from outside the region, and the contour stops where it meets them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import table
from commands import Command

import ffseg
from ffseg.errors import ParameterError, SegmentationError
from ffseg.metrics import iou
from ffseg.parameters import click_radius
from tests.discs import bright_disc
from tests.masks import read_mask, write_image


def rooms(gap: int = 30) -> np.ndarray:
    """Two rooms side by side, each 80 px wide, and a door of `gap` px between them."""
    image = np.full((100, 164), 180, np.uint8)
    image[:, 80:84] = 40
    image[50 - gap // 2 : 50 + gap // 2, 80:84] = 180
    return image


START = {"init.center": [30, 50], "init.radius": 8}
START_OPTIONS = ("--set", "init.center=[30,50]", "--set", "init.radius=8")


@pytest.mark.parametrize("method", ["freeform", "levelset"])
def test_the_contour_stops_in_an_open_door(method: str) -> None:
    image, params = rooms(), {**START, "method": method}
    assert ffseg.segment(image, params).mask[50, 140]
    found = ffseg.segment(image, {**params, "init.background": [[133, 50, 8]]})
    assert not found.mask[:, 90:].any()
    assert found.mask[:, :76].mean() > 0.95
    # Alike on both sides, the fronts meet half-way: in the door.
    reach = np.nonzero(found.mask[50])[0].max()
    assert abs(reach - 81.5) < 3


def test_a_point_will_do_and_the_meeting_is_half_way() -> None:
    flat = np.full((60, 200), 90, np.uint8)
    found = ffseg.segment(flat, {"init.center": [40, 30], "init.radius": 8, "init.background": [[150, 30]]})
    # From the rims at 48 and 148 (a point is a disc of 2 px) to the middle, 98.
    assert abs(np.nonzero(found.mask[30])[0].max() - 98) < 2


@pytest.mark.parametrize("radius", [0.1, 0.5, 1.0])
def test_a_circle_of_less_than_two_pixels_is_one_of_two(radius: float) -> None:
    """It lay in the region, up to 30 px deep: it was narrower than what holds a contour."""
    room = np.full((120, 150), 150, np.uint8)
    cv2.rectangle(room, (10, 10), (139, 109), 60, 3)
    start = {"init.center": [40, 60], "init.radius": 12}
    least, small = (ffseg.segment(room, {**start, "init.background": [[100, 60, r]]}) for r in (2.0, radius))
    np.testing.assert_array_equal(least.mask, small.mask)
    assert not small.mask[60, 100]


def test_a_point_is_a_click() -> None:
    """It was a disc of 2 px, too narrow to teach anything: 47 photographs had an IoU of .64 after three clicks for .77."""
    points, clicks = (beside_a_disc("hints", (340, 60, *radius)) for radius in ((), (click_radius((120, 400)),)))
    np.testing.assert_array_equal(points.mask, clicks.mask)
    assert not points.mask[60, 330:350].any()


def beside_a_disc(source: str, *seeds: tuple[float, ...]) -> ffseg.Segmentation:
    """Plain ground with a disc at (340, 60), of radius 25, far from the start."""
    image = bright_disc((120, 400), (340, 60), 25)
    start = {"init.center": [30, 60], "init.radius": 8, "edges.source": source}
    return ffseg.segment(image, {**start, "init.background": seeds})


@pytest.mark.parametrize("source", ["gradient", "auto"])
def test_a_seed_in_what_edges_leave_out_changes_nothing(source: str) -> None:
    """Its front ran through the wall, and took what lies far from the start."""
    alone, told = beside_a_disc(source), beside_a_disc(source, (340, 60, 4))
    np.testing.assert_array_equal(told.mask, alone.mask)
    assert told.score == alone.score


def test_a_seed_that_laps_over_the_rim_is_kept_out_and_no_more() -> None:
    alone, told = beside_a_disc("gradient").mask, beside_a_disc("gradient", (340, 37, 4)).mask
    assert not told[34, 340]
    assert np.count_nonzero(alone & ~told) < 60


def test_the_border_of_the_image_as_a_rival() -> None:
    """A dark thing whose outline is open at one place: with the border outside, the hole in it does not leak."""
    image = np.full((140, 180), 200, np.uint8)
    cv2.circle(image, (90, 70), 40, 60, 5)
    image[66:75, 120:140] = 200
    y, x = np.mgrid[:140, :180]
    truth = np.where(np.hypot(x - 90, y - 70) < 38, np.uint8(255), np.uint8(0))
    start = {"init.center": [90, 70], "init.radius": 10}
    assert iou(ffseg.segment(image, start).mask, truth) < 0.3
    assert iou(ffseg.segment(image, {**start, "region.border": "outside"}).mask, truth) > 0.9


def test_a_mask_of_the_background() -> None:
    image, outside = rooms(), np.zeros((100, 164), np.uint8)
    outside[20:80, 130:160] = 1
    found = ffseg.segment(image, START, background=outside)
    assert not found.mask[:, 100:].any()
    assert np.array_equal(ffseg.segment(image, START, background=outside > 0).mask, found.mask)
    with pytest.raises(SegmentationError, match="background mask has 3 x 2 pixels, the image 164 x 100"):
        ffseg.segment(image, START, background=np.ones((2, 3), np.uint8))


def test_the_domain_still_holds() -> None:
    domain = np.zeros((100, 164), np.uint8)
    domain[:, :60] = 255
    found = ffseg.segment(rooms(), {**START, "init.background": [[133, 50]]}, domain=domain)
    assert not found.mask[:, 62:].any()
    assert found.mask[:, :58].mean() > 0.95


def test_seeds_that_cannot_be() -> None:
    said = r"background seed at \(500, 50\) has its centre outside the image of 164 x 100"
    with pytest.raises(SegmentationError, match=said):
        ffseg.segment(rooms(), {**START, "init.background": [[500, 50]]})
    with pytest.raises(SegmentationError, match="lies in the start region"):
        ffseg.segment(rooms(), {**START, "init.background": [[31, 51]]})
    with pytest.raises(ParameterError, match=r"init.background\[0\]: .* is not \[x, y\] or \[x, y, radius\]"):
        ffseg.load_params(None, {"init.background": [[5]]})
    with pytest.raises(ParameterError, match="region.border"):
        ffseg.load_params(None, {"region.border": "inside"})


def test_commands_take_not(ffseg_command: Command, tmp_path: Path) -> None:
    write_image(tmp_path / "rooms.png", rooms())
    given = (*START_OPTIONS, "--not", "133,50,8", "--not", "140,20")
    ffseg_command("segment", tmp_path / "rooms.png", tmp_path / "mask.png", *given, code=0)
    mask = read_mask(tmp_path / "mask.png")
    assert mask[50, 40]
    assert not mask[:, 90:].any()
    ffseg_command("run", tmp_path / "rooms.png", "--out", tmp_path / "out", *given, code=0)
    assert np.array_equal(read_mask(tmp_path / "out/masks/rooms.png"), mask)


def test_a_run_reads_the_background_mask(ffseg_command: Command, tmp_path: Path) -> None:
    rows, columns = np.indices((100, 164))
    outside = (rows >= 20) & (rows < 80) & (columns >= 130) & (columns < 160)
    write_image(tmp_path / "rooms.png", rooms())
    write_image(tmp_path / "outside.png", outside)
    named = ("--set", f"init.background_mask={tmp_path / 'outside.png'}")
    run = ("run", tmp_path / "rooms.png", "--out", tmp_path / "out", *START_OPTIONS, *named)
    ffseg_command(*run, code=0)
    assert not read_mask(tmp_path / "out/masks/rooms.png")[:, 100:].any()
    write_image(tmp_path / "outside.png", np.roll(outside, -30, axis=1))
    assert "--overwrite" in ffseg_command(*run, code=2).stderr  # another mask is another parameter
    assert [row["status"] for row in table(tmp_path / "out" / "timings.csv")] == ["ok"]
