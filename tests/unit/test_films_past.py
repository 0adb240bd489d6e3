"""Frames in order: what the frame before is good for, and what it must never do."""

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from batches import snapshot, table
from commands import Command
from drawn_films import pictures, write_film

from ffseg.batch.workers.past import PastFrame
from ffseg.image.flow import BOUNDARY_BAND, carried_region, origins, start_in, steadied_region
from ffseg.image.free import distances
from ffseg.image.parts import connected_parts
from ffseg.io.images import Limits
from ffseg.io.starts import Start
from ffseg.parameter_files import load_params
from tests.discs import disc_of, overlap
from tests.masks import read_mask, write_image

disc = disc_of((120, 160))
GROUND = np.random.default_rng(2).integers(60, 90, (120, 160), dtype=np.uint8)


def test_a_region_goes_where_motion_takes_it() -> None:
    texture = np.random.default_rng(1).integers(0, 60, (120, 160), dtype=np.uint8)
    before = np.where(disc(70, 60, 30), 180 + texture // 2, GROUND).astype(np.uint8)
    now = np.where(disc(76, 64, 30), 180 + np.roll(texture, (4, 6), (0, 1)) // 2, GROUND).astype(np.uint8)
    region = carried_region(disc(70, 60, 30), origins(before, now))
    assert overlap(region, disc(76, 64, 30)) > 0.97
    assert overlap(disc(70, 60, 30), disc(76, 64, 30)) < 0.8
    in_colour = origins(np.dstack([before] * 3), np.dstack([now] * 3))
    assert overlap(carried_region(disc(70, 60, 30), in_colour), region) > 0.99


@pytest.mark.parametrize("shape", [(1, 1), (2, 100), (8, 100), (24, 400), (100, 7)])
def test_the_smallest_frames_are_carried_too(shape: tuple[int, int]) -> None:
    """OpenCV's flow refuses some of them and ends the process at others."""
    image = np.random.default_rng(1).integers(0, 255, shape, dtype=np.uint8)
    assert overlap(carried_region(image >= 0, origins(image, image)), image >= 0) == 1


def test_the_outline_goes_half_way_where_the_two_lie_close() -> None:
    assert overlap(steadied_region(disc(80, 60, 32), disc(80, 60, 30)), disc(80, 60, 31)) > 0.98
    far = disc(80, 60, 30 + 3 * BOUNDARY_BAND)
    assert np.array_equal(steadied_region(far, disc(80, 60, 30)), far)
    nothing = np.zeros_like(far)
    assert np.array_equal(steadied_region(nothing, far), nothing)
    assert np.array_equal(steadied_region(far, nothing), far)


@pytest.mark.parametrize("seed", range(12))
def test_the_half_way_is_that_of_the_distances_to_both(seed: int) -> None:
    """Which are looked at only where the two differ, and no further than the band."""
    rng = np.random.default_rng(seed)
    noise = cv2.GaussianBlur(rng.normal(size=(60, 70)), (0, 0), rng.uniform(0.5, 5))
    more = noise + 0.3 * cv2.GaussianBlur(rng.normal(size=(60, 70)), (0, 0), rng.uniform(0.5, 5))
    own, before = noise > np.median(noise), more > np.median(more)
    depth, old = (np.where(one, distances(one) - 0.5, 0.5 - distances(~one)) for one in (own, before))
    open_to_border = connected_parts(~own, corners=True).labels
    rim = np.concatenate([open_to_border[[0, -1]].ravel(), open_to_border[:, [0, -1]].ravel()])
    near = (abs(depth) <= BOUNDARY_BAND) & (abs(old) <= BOUNDARY_BAND) & (own | np.isin(open_to_border, rim[rim > 0]))
    assert np.array_equal(steadied_region(own, before), np.where(near, depth + old > 0, own))


@pytest.mark.parametrize("radius", [0, 1, 2, 4, 8])
@pytest.mark.parametrize("x", [80, 105, 108])
def test_a_hole_is_never_held_closed(x: int, radius: int) -> None:
    """Also one of a pixel, or close to the outline, where the past would outvote it."""
    whole, hole = disc(80, 60, 34), disc(x, 60, radius) & disc(80, 60, 32)
    found = steadied_region(whole & ~hole, whole)
    assert not (found & hole).any()


def test_a_start_moves_no_further_than_it_must() -> None:
    region = disc(60, 60, 30)
    assert start_in(region, (62.0, 58.0, 8.0)) == (62.0, 58.0, 8.0)
    x, y, radius = start_in(region, (130.0, 60.0, 8.0))
    assert (y, radius) == (60, 8)
    assert 78 <= x <= 82
    assert start_in(np.zeros_like(region), (5.0, 5.0, 8.0)) == (5.0, 5.0, 8.0)
    assert start_in(disc(60, 60, 6), (60.0, 60.0, 50.0))[2] < 6


def test_a_box_goes_along_with_what_is_in_it() -> None:
    """Specks have none; a box that the parameters give to every frame stays."""
    past, image = (
        PastFrame(steady=True, limits=Limits()),
        np.random.default_rng(1).integers(0, 255, (120, 160), np.uint8),
    )
    before = disc(70, 60, 30) | disc(130, 20, 1)
    past.carry((image, before), image)
    held = Start(x=1, y=1, boxes=((0, 0, 20, 20),), background=((5, 5),)).next_frame()
    params = held.placed(load_params(), before.shape)
    assert (params.init.circles, params.init.background) == ((), ())
    (box,) = past.start(params, before.shape, held).init.boxes
    assert np.allclose(box, (40 - 3, 30 - 3, 100 + 3, 90 + 3), atol=1)
    assert past.start(params, before.shape, None) == params


@pytest.fixture
def ran(ffseg_command: Command) -> Command:
    return lambda film, out, *options: ffseg_command("run", film, "--out", out, *options)


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return write_film(tmp_path / "film.mp4", pictures(10, (160, 120), noise=25))


def test_steady_films_resume_to_the_same_bytes_and_flicker_less(film: Path, tmp_path: Path, ran: Command) -> None:
    measured, straight, out = tmp_path / "measured", tmp_path / "straight", tmp_path / "out"
    assert ran(film, measured, "--flicker").returncode == 0
    done = ran(film, straight, "--steady")
    assert done.returncode == 0, done.stderr
    assert "px a frame" in done.stdout
    flicker = {name: [row["flicker"] for row in table(name / "timings.csv")] for name in (measured, straight)}
    assert [values[0] for values in flicker.values()] == ["", ""]
    means = {name: np.mean([float(value) for value in values[1:]]) for name, values in flicker.items()}
    assert means[straight] < 0.8 * means[measured]
    assert sum(int(row["steady_px"] or 0) for row in table(straight / "timings.csv")) > 0
    assert ran(film, tmp_path / "plain").returncode == 0
    assert snapshot(tmp_path / "plain") == snapshot(measured)  # to measure changes nothing
    ran(film, out, "--steady", "--exclude", "*_00000[4-9].mp4")  # as far as a run came that was stopped
    assert (ran(film, out, "--steady").returncode, snapshot(out)) == (0, snapshot(straight))


@pytest.fixture(scope="module")
def meeting(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[np.ndarray]]:
    """Frames of two discs that meet and part, and their truths."""
    folder, rng, truths = tmp_path_factory.mktemp("meeting"), np.random.default_rng(3), []
    for number in range(14):
        pixels = np.full((120, 160, 3), 60.0)
        one, other = disc(35 + 6 * number, 50, 18), disc(125 - 6 * number, 66, 16)
        pixels[one], pixels[other] = (60, 120, 200), (120, 200, 60)
        write_image(
            folder / f"f_{number:06d}.png", (pixels + rng.normal(0, 4, pixels.shape)).clip(0, 255).astype(np.uint8)
        )
        truths.append(one | other)
    return folder, truths


@pytest.mark.parametrize(
    "rows",
    ["start,35,50,6,,,\nf_000000.png,start,125,66,6,,,", "box,16,31,,54,69,\nf_000000.png,box,108,49,,142,83,"],
)
def test_what_was_picked_in_one_frame_is_followed(
    rows: str, meeting: tuple[Path, list[np.ndarray]], tmp_path: Path, ran: Command
) -> None:
    """Several starts stayed where they were while things moved on, and frames without rows started as the parameters say."""
    folder, truths = meeting
    (tmp_path / "starts.csv").write_text(f"image,kind,x,y,radius,right,bottom,value\nf_000000.png,{rows}\n")
    done = ran(folder, tmp_path / "out", "--steady", "--starts", tmp_path / "starts.csv")
    assert (done.returncode, "without a row" in done.stderr) == (0, False)
    masks = [read_mask(tmp_path / "out" / "masks" / f"f_{number:06d}.png") for number in range(len(truths))]
    assert min(map(overlap, masks, truths)) > 0.85  # an outline half-way to that of the frame before lags by up to 3 px
    assert not any(row["start_x"] for row in table(tmp_path / "out" / "timings.csv")[1:])


def test_what_was_picked_is_followed_over_frames_that_fail(
    meeting: tuple[Path, list[np.ndarray]], tmp_path: Path, ran: Command
) -> None:
    """Frames behind a damaged one began again where the first one did, and took whatever was there by then."""
    folder, out = Path(shutil.copytree(meeting[0], tmp_path / "film")), tmp_path / "out"
    for number in (2, 3):
        (folder / f"f_{number:06d}.png").write_bytes(b"")
    (tmp_path / "starts.csv").write_text("image,x,y,radius\nf_000000.png,35,50,6\n")
    options = "--steady", "--starts", tmp_path / "starts.csv"
    assert ran(folder, out, *options).returncode == 3
    assert overlap(read_mask(out / "masks" / "f_000004.png"), disc(35 + 6 * 4, 50, 18)) > 0.8
    for first in "1234":  # as far as a run came that was stopped before
        again = tmp_path / f"before {first}"
        ran(folder, again, *options, "--exclude", f"*_00000[{first}-9]*", "--exclude", "*_00001*")
        ran(folder, again, *options)
        assert snapshot(again) == snapshot(out)


@pytest.mark.parametrize("rows", ["start,60,50,6,,,", "box,40,30,,80,70,"])
def test_what_leaves_the_picture_or_is_hidden_leaves_empty_masks(rows: str, tmp_path: Path, ran: Command) -> None:
    """The start went to what was left at the border, or in front, and all that lay there was followed from then on."""
    folder, out, rng, truths = tmp_path / "film", tmp_path / "out", np.random.default_rng(3), []
    folder.mkdir()
    for number in range(20):
        pixels, thing = np.full((120, 160, 3), 60.0), disc(60 if number < 8 else 60 + 9 * (number - 7), 50, 18)
        pixels[thing] = (60, 120, 200)
        if number in {3, 4, 5}:
            pixels[20:90, 30:130] = (90, 160, 90)
            thing[:] = False
        write_image(
            folder / f"f_{number:06d}.png", (pixels + rng.normal(0, 4, pixels.shape)).clip(0, 255).astype(np.uint8)
        )
        truths.append(thing)
    starts = tmp_path / "starts.csv"
    starts.write_text(f"image,kind,x,y,radius,right,bottom,value\nf_000000.png,{rows}\n")
    done = ran(folder, out, "--steady", "--starts", starts)
    assert done.returncode == 0, done.stderr
    masks = [read_mask(out / "masks" / f"f_{number:06d}.png") for number in range(len(truths))]
    assert [bool(mask.any()) for mask in masks] == [truth.sum() > 10 for truth in truths]
    assert min(overlap(mask, truth) for mask, truth in zip(masks, truths, strict=True) if truth.sum() > 200) > 0.8
    noted = [row["image"] for row in table(out / "timings.csv") if "what was followed is not seen here" in row["note"]]
    assert noted == [f"f_{number:06d}.png" for number, mask in enumerate(masks) if not mask.any()]
    again = tmp_path / "again"
    ran(folder, again, "--steady", "--starts", starts, "--exclude", "*_00000[5-9]*", "--exclude", "*_00001*")
    ran(folder, again, "--steady", "--starts", starts)
    assert snapshot(again) == snapshot(out)
    frames = b"".join(cv2.imread(str(folder / f"f_{number:06d}.png")).tobytes() for number in range(len(truths)))
    run = sys.executable, "-m", "ffseg", "run", "-", "--out", "-", "--raw", "160x120:bgr24", "--steady", "--starts"
    piped = subprocess.run([*run, str(starts)], input=frames, capture_output=True, check=True)
    found = np.frombuffer(piped.stdout, np.uint8).reshape(-1, 120, 160) > 0
    assert np.array_equal(found, masks)


@pytest.mark.parametrize("width", [1, 2, 3, 9])
def test_what_is_thin_is_not_taken_for_gone(width: int) -> None:
    past, rng = PastFrame(steady=True, limits=Limits()), np.random.default_rng(5)
    ground, region = rng.integers(60, 70, (120, 160), np.uint8), np.zeros((120, 160), np.bool_)
    region[20:100, 70 : 70 + width] = True
    image = np.where(region, np.uint8(200), ground)
    held = Start(x=70.0, y=60.0, radius=1.0).next_frame()
    past.carry((image, region), image)
    assert past.absent(held) is None
    past.carry((image, region), ground)
    gone = past.absent(held)
    assert gone is not None
    assert (gone.mask.any(), gone.doubts) == (False, ("empty",))
    for other in (None, Start(x=70.0, y=60.0), Start(probability=0.4).next_frame(), replace(held, found=True)):
        assert past.absent(other) is None  # nothing was picked before, or a model looks for itself


def test_a_frame_with_rows_of_its_own_starts_there(
    meeting: tuple[Path, list[np.ndarray]], tmp_path: Path, ran: Command
) -> None:
    (tmp_path / "starts.csv").write_text("image,x,y,radius\nf_000000.png,35,50,6\nf_000002.png,113,66,6\n")
    run = meeting[0], tmp_path / "out", "--steady", "--starts", tmp_path / "starts.csv", "--exclude", "*_00000[4-9]*"
    planned = ran(*run, "--dry-run").stdout.splitlines()
    assert ["(follows the frame before)" in line for line in planned[:4]] == [False, True, False, True]
    ran(*run)
    found = [read_mask(tmp_path / "out" / "masks" / f"f_{number:06d}.png") for number in range(4)]
    assert [overlap(mask, disc(35 + 6 * k, 50, 18)) > 0.8 for k, mask in enumerate(found)] == [True, True, False, False]
    assert [overlap(mask, disc(125 - 6 * k, 66, 16)) > 0.8 for k, mask in enumerate(found)] == [
        False,
        False,
        True,
        True,
    ]


def test_a_frame_is_done_again_when_the_mask_before_it_is_another(film: Path, tmp_path: Path, ran: Command) -> None:
    out = tmp_path / "out"
    ran(film, out, "--steady")
    before = snapshot(out)
    (out / "masks" / "film_000004.png").unlink()
    ran(film, out, "--steady")
    assert snapshot(out) == before


@pytest.mark.parametrize("other", [("--shard", "1/2"), ("--pack", "tar")])
def test_what_cannot_go_in_order_is_refused(film: Path, tmp_path: Path, ran: Command, other: tuple[str, str]) -> None:
    done = ran(film, tmp_path / "out", "--steady", *other)
    assert done.returncode == 2
    assert f"--steady and {other[0]} do not go together: every frame needs the one before it" in done.stderr


def test_steady_frames_do_not_mix_with_others(film: Path, tmp_path: Path, ran: Command) -> None:
    ran(film, tmp_path / "out", "--exclude", "*_00000[3-9].mp4")
    done = ran(film, tmp_path / "out", "--steady")
    assert done.returncode == 2
    assert 'past was null, is "steady"' in done.stderr


def test_images_of_two_folders_are_not_one_film(tmp_path: Path, ffseg_command: Command) -> None:
    for number, name in enumerate(("a/1.png", "a/2.png", "b/3.png", "b/4.png")):
        write_image(tmp_path / name, np.where(disc(60 + 4 * number, 60, 30), 200, 60).astype(np.uint8))
    ffseg_command("run", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "out", "--flicker", code=0)
    rows = table(tmp_path / "out" / "timings.csv")
    assert [(row["image"], bool(row["flicker"])) for row in rows] == [(f"{n}.png", n in (2, 4)) for n in (1, 2, 3, 4)]
