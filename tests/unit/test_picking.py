"""Picking without a browser: what is kept, what is written, who is answered."""

import dataclasses
import json
import os
import shlex
import socket
import struct
import subprocess
import sys
import threading
import time
from itertools import pairwise
from pathlib import Path
from unittest.mock import Mock

import cv2
import numpy as np
import pick_page
import pytest
from commands import Command
from drawn_films import pictures, write_film
from hypothesis import given
from hypothesis import strategies as st
from pick_page import LEFT, OPEN, RIGHT, SIZE, ask, disc, draw, mask_of, picked, served, session

import ffseg
from ffseg.errors import OutputError, UsageError
from ffseg.evidence.forest import Model, to_bytes
from ffseg.io.files import temporary_path
from ffseg.io.labels import read_labels
from ffseg.io.masks import encode_mask
from ffseg.io.starts import load_starts
from ffseg.parameter_files import load_params
from ffseg.picking import open_image as scenes
from ffseg.picking import project
from ffseg.picking.learner import Background
from ffseg.picking.open_image import OpenImage, PickedRegion
from ffseg.picking.picks import ImagePicks, Journal, Stroke, paint_strokes
from ffseg.picking.project import Project
from ffseg.picking.server import Server
from ffseg.picking.session import Session, StaleError, settings_of
from tests.discs import overlap
from tests.masks import write_image
from tests.stumps import stump

Started = list[list[str]]
A_MODEL = to_bytes(Model(stump("likeness", 0.0)))
POINT = st.tuples(st.floats(-5, 30), st.floats(-5, 25))


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> Started:
    """Commands that would run behind the page; none does: a model would change what is found."""
    found: Started = []
    monkeypatch.setattr(Background, "start", lambda _self, arguments: found.append(list(arguments)))
    return found


def accept(own: Session, *images: int) -> None:
    for index in images:
        own.change(0, index, 0, "pick", picked(LEFT, status="accepted"))


@given(st.lists(POINT, min_size=1, max_size=4), st.floats(0.5, 8), st.booleans())
def test_strokes_paint_the_pixels_whose_centres_are_near(points: list, radius: float, inside: bool) -> None:
    before = np.zeros((20, 24), np.bool_)
    before[5:15, 5:20] = True
    found = paint_strokes(before, (Stroke(inside, radius, tuple(points)),))
    y, x = np.mgrid[:20, :24]
    places = np.stack([x, y], axis=-1).astype(float)
    distance = np.full((20, 24), np.inf)
    for a, b in zip(points, points[1:] or points, strict=False):
        along = np.array(b) - a
        length = float(along @ along)
        share = np.clip((places - a) @ along / length, 0, 1) if length else np.zeros((20, 24))
        distance = np.minimum(distance, np.linalg.norm(places - a - share[..., None] * along, axis=-1))
    clear = np.abs(distance - radius) > 1e-9  # a centre on the rim itself may fall either way
    wanted = np.where(distance <= radius, inside, before)
    assert np.array_equal(found[clear], wanted[clear])


BAD = [
    None, [], "x", {"starts": [[1, 2]]}, {"starts": [[1, 2, 0]]}, {"starts": [[1, 2, float("nan")]]}, {"boxes": [[1, 2, 3]]},
    {"starts": [[1, 2, 1e9]]}, {"strokes": [{"inside": True, "radius": 3, "points": []}]}, {"strokes": [{}]},
    {"nots": [[1, 2, 3]] * 1001}, {"status": "done"}, {"probability": "x"}, {"strokes": 3}, {"status": []},
    {"starts": [[10**400, 1, 1]]}, {"starts": [[1, 2, 3, 0]]}, {"nots": [[1, 2, 3, -1]]}, {"nots": [[1, 2, 3, 0, 0]]},
]  # fmt: skip


@pytest.mark.parametrize("document", BAD)
def test_what_is_not_picked_is_refused(document: object) -> None:
    with pytest.raises(UsageError):
        ImagePicks.read(document)


def test_a_journal_gives_back_every_step_and_drops_a_torn_line(tmp_path: Path) -> None:
    path = str(tmp_path / "picks.jsonl")
    journal = Journal(path)
    one, two = ImagePicks.read(picked(LEFT)), ImagePicks.read(picked(LEFT, RIGHT, probability=0.3))
    for do, what in (("pick", one), ("pick", two), ("undo", None), ("redo", None), ("undo", None)):
        assert journal.add("\udcff.png", do, what)
    assert not journal.add("b.png", "undo")
    track = journal.track("\udcff.png")
    assert (track.now, track.version) == (one, 5)
    journal.close()
    with Path(path).open("ab") as file:
        file.write(b'{"image":"b.png","do":"pi')
    again = Journal(path)
    assert again.track("\udcff.png") == track
    assert "b.png" not in again.tracks
    again.add("c.png", "pick", one)
    again.close()
    assert Journal(path).track("c.png").now == one
    for line in (b'{"image":"b.png"}\n', b"[" * 100_000 + b"\n"):
        Path(path).write_bytes(line)
        with pytest.raises(OutputError, match=r"picks\.jsonl:1 is no step of ffseg pick"):
            Journal(path)


def test_a_step_that_cannot_be_written_is_not_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal(str(tmp_path / "picks.jsonl"))
    journal.add("a", "pick", ImagePicks.read(picked(LEFT)))

    def full(_descriptor: int) -> None:
        raise OSError(28, "full")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="free some space"):
        journal.add("a", "pick", ImagePicks.read(picked(RIGHT)))
    monkeypatch.undo()
    assert (journal.track("a").version, len((tmp_path / "picks.jsonl").read_bytes().splitlines())) == (1, 1)


@pytest.mark.usefixtures("started")
def test_a_click_takes_the_disc_and_a_run_takes_the_same(tmp_path: Path, ffseg_command: Command) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "sub/b.png"]), tmp_path / "out"
    with session(folder, out) as own:
        own.change(0, 0, 0, "pick", picked(LEFT))
        own.change(0, 0, 1, "pick", picked(LEFT, status="accepted"))
        boxed = picked(LEFT, RIGHT, nots=[[80, 10, 5], [10, 70, 5, 1]], probability=0.4, status="accepted")
        own.change(0, 1, 0, "pick", boxed)
    masks = [mask_of(out / "masks" / name) for name in ("a.png", "sub/b.png")]
    assert overlap(masks[0], disc(LEFT)) > 0.95
    assert overlap(masks[1], disc(LEFT) | disc(RIGHT)) > 0.9
    assert set(load_starts(out / "starts.csv", ["a.png", "sub/b.png"])) == {"a.png", "sub/b.png"}
    line = (out / "run.sh").read_text().splitlines()[1].split()
    assert line[:2] == ["ffseg", "run"]
    ffseg_command(*line[1:], code=0)
    for name in ("a.png", "sub/b.png"):
        assert (out / "run" / "masks" / name).read_bytes() == (out / "masks" / name).read_bytes()


def test_the_command_works_anywhere(tmp_path: Path, ffseg_command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    draw(tmp_path / "in", ["a.png"])
    monkeypatch.chdir(tmp_path)
    with Session(["in/*.png"], "out", load_params()) as own:
        own.change(0, 0, 0, "pick", picked(LEFT))
    monkeypatch.chdir(tmp_path / "in")
    line = shlex.split((tmp_path / "out" / "run.sh").read_text().splitlines()[1])
    ffseg_command(*line[1:], code=0)
    assert overlap(mask_of(tmp_path / "out" / "run" / "masks" / "a.png"), disc(LEFT)) > 0.95


def test_undoing_takes_a_mask_back_and_a_restart_changes_nothing(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png"]), tmp_path / "out"
    mask = out / "masks" / "a.png"
    with session(folder, out) as own:
        own.change(0, 0, 0, "pick", picked(LEFT))
        own.change(0, 0, 1, "pick", picked(LEFT, status="accepted"))
        own.change(0, 1, 0, "pick", OPEN | {"status": "skipped"})
        assert mask.is_file()
        assert (own.statuses(0), own.following(0, 0)) == ({0: "accepted", 1: "skipped"}, -1)
        own.change(0, 0, 2, "undo")
        assert not mask.exists()
        assert own.following(0, 1) == 0
        own.change(0, 0, 3, "redo")
        stroke = {"inside": False, "radius": 9, "points": [[45, 60]]}
        own.change(0, 0, 4, "pick", picked(LEFT, strokes=[stroke], status="accepted"))
        before = own.image(0, 0)
    assert not mask_of(mask)[60, 45]
    files = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with session(folder, out) as own:
        assert (own.image(0, 0), own.image(0, 0)["undo"]) == (before, 3)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == files


def test_what_a_crash_has_left_undone_is_done_at_the_next_start(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png"]), tmp_path / "out"
    with session(folder, out) as own:
        accept(own, 0, 1)
        own.change(0, 1, 1, "pick", picked(LEFT))
    whole = (out / "masks" / "a.png").read_bytes()
    (out / "masks" / "a.png").unlink()  # accepted, killed before it was written
    (out / "masks" / "b.png").write_bytes(whole)  # open again, killed before it was removed
    (out / "starts.csv").unlink()
    left = Path(temporary_path(str(out / "masks" / "a.png")))  # killed while it was written
    left.write_bytes(whole)
    with session(folder, out):
        assert not left.exists()
        assert (out / "masks" / "a.png").read_bytes() == whole
        assert not (out / "masks" / "b.png").exists()
        assert set(load_starts(out / "starts.csv", ["a.png", "b.png"])) == {"a.png", "b.png"}


@pytest.mark.parametrize(("how", "place"), [("killed", RIGHT), ("full", LEFT)])
def test_masks_match_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, place: tuple[int, int]) -> None:
    """What a crash kept from being written is made at the next start; a step that cannot be written is not taken."""
    folder, out = draw(tmp_path / "in", ["a.png"]), tmp_path / "out"
    mask, later = out / "masks" / "a.png", picked(RIGHT, status="accepted")
    error = {"killed": KeyboardInterrupt(), "full": OutputError("full")}[how]

    def stopped(*_of: object) -> None:
        raise error

    with session(folder, out) as own:
        accept(own, 0)
        monkeypatch.setattr(project, "write_all_atomic", stopped)
        with pytest.raises(type(error)):
            own.change(0, 0, 1, "pick", later)
        monkeypatch.undo()
        version = own.image(0, 0)["version"]
        assert version == {"killed": 2, "full": 1}[how]
    with session(folder, out) as own:
        assert own.image(0, 0)["version"] == version
    assert overlap(mask_of(mask), disc(place)) > 0.95


def test_a_step_on_what_was_changed_elsewhere_is_refused(tmp_path: Path) -> None:
    with session(draw(tmp_path / "in", ["a.png"]), tmp_path / "out") as own:
        own.change(0, 0, 0, "pick", picked(LEFT))
        with pytest.raises(StaleError):
            own.change(0, 0, 0, "pick", picked(LEFT))
        assert (own.image(0, 0)["picked"]["starts"], own.image(0, 0)["version"]) == (((*LEFT, 6),), 1)
        with pytest.raises(UsageError, match="pick a region first"):
            own.change(0, 0, 1, "pick", OPEN | {"status": "accepted"})


def test_no_step_is_taken_in_a_folder_that_was_moved_away(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with session(draw(tmp_path / "in", ["a.png", "b.png"]), out) as own:
        accept(own, 0)
        moved = out.rename(tmp_path / "moved")
        with pytest.raises(OutputError, match="was moved, removed or replaced since ffseg pick began"):
            own.change(0, 1, 0, "pick", picked(LEFT, status="accepted"))
        assert not out.exists()
        moved.rename(out)
        accept(own, 1)
    assert (out / "masks" / "b.png").is_file()


def test_masks_of_a_run_stand_until_something_is_picked(tmp_path: Path, ffseg_command: Command) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png"]), tmp_path / "out"
    place = f"init.center={list(RIGHT)}"
    ffseg_command("run", folder, "--out", tmp_path / "run", "--set", place, "--set", "init.radius=6", code=0)
    with session(folder, out, review=str(tmp_path / "run")) as own:
        own.change(0, 0, 0, "pick", OPEN | {"status": "accepted"})
        accept(own, 1)
    assert (out / "masks" / "a.png").read_bytes() == (tmp_path / "run" / "masks" / "a.png").read_bytes()
    assert overlap(mask_of(out / "masks" / "b.png"), disc(LEFT)) > 0.95


def test_a_reviewed_mask_stays_when_the_run_is_gone(tmp_path: Path, ffseg_command: Command) -> None:
    folder, out = draw(tmp_path / "in", ["a.png"]), tmp_path / "out"
    ffseg_command("run", str(folder), "--out", str(tmp_path / "run"), "--set", "init.center=[45, 60]")
    with session(folder, out, review=str(tmp_path / "run")) as own:
        assert "use the brush" in own.find(0, 0, OPEN | {"nots": [[45, 60, 4]]}, quick=False)["said"]
        own.change(0, 0, 0, "pick", OPEN | {"status": "accepted"})
    kept = mask_of(out / "masks" / "a.png")
    assert kept.any()
    with session(folder, out) as own:
        own.change(0, 0, 1, "pick", OPEN | {"status": "skipped"})
        own.change(0, 0, 2, "undo")
    assert np.array_equal(mask_of(out / "masks" / "a.png"), kept)


def test_a_review_shows_its_own_run_packed_or_not(tmp_path: Path, ffseg_command: Command) -> None:
    """Of an image that was given up, too: what was kept of an earlier review is for steps that are undone and redone."""
    folder, out = draw(tmp_path / "in", ["a.png"]), tmp_path / "out"
    for place, run, more in ((LEFT, "one", []), (RIGHT, "two", ["--pack", "tar"])):
        settings = ["--set", f"init.center={list(place)}", "--set", "init.radius=6", *more]
        ffseg_command("run", str(folder), "--out", str(tmp_path / run), *settings, code=0)
    masks = [disc(LEFT), disc(RIGHT)]
    with session(folder, out, review=str(tmp_path / "one")) as own:
        own.change(0, 0, 0, "pick", OPEN | {"status": "accepted"})
        own.change(0, 0, 1, "pick", OPEN)
    with session(folder, out, review=str(tmp_path / "two")) as own:
        assert overlap(own._found(own.projects[0], 0, ImagePicks()).mask, masks[1]) > 0.95
        own.change(0, 0, 2, "undo")
        assert overlap(mask_of(out / "masks" / "a.png"), masks[0]) > 0.95
        own.change(0, 0, 3, "pick", OPEN)
        own.change(0, 0, 4, "pick", OPEN | {"status": "accepted"})
    assert overlap(mask_of(out / "masks" / "a.png"), masks[1]) > 0.95


def test_a_mask_that_cannot_be_removed_keeps_its_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with session(draw(tmp_path / "in", ["a.png"]), tmp_path / "out") as own:
        accept(own, 0)
        monkeypatch.setattr(project.os, "unlink", Mock(side_effect=PermissionError(13, "no")))
        with pytest.raises(OutputError, match=r"a\.png cannot be written"):
            own.change(0, 0, 1, "pick", picked(LEFT))
        assert own.image(0, 0)["picked"]["status"] == "accepted"


def test_what_a_model_that_has_gone_is_finding_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, asked = OpenImage(np.zeros(SIZE, np.uint8)), list[object]()

    def grow(self: OpenImage, image: np.ndarray, factor: float, *_of: object, **_how: object) -> PickedRegion:
        asked.append(image)
        if len(asked) == 1:
            self.forget()
        return PickedRegion(disc(LEFT), (), factor)

    monkeypatch.setattr(OpenImage, "_grown", grow)
    for _ in range(3):
        scene.find(ImagePicks(((*LEFT, 6),)), load_params(), None)
    assert len(asked) == 2


def test_only_a_model_that_finds_starts_proposes_a_region(tmp_path: Path) -> None:
    scene, path = OpenImage(np.where(disc(LEFT), 200, 50).astype(np.uint8)), tmp_path / "a.ffmodel"
    params = load_params(None, {"edges.model": str(path)})
    placed = load_params(None, {"edges.model": str(path), "init.center": list(LEFT)})
    for start, proposed in ((None, False), (stump("light@0.7", 150.0), True)):
        path.write_bytes(to_bytes(Model(stump("light@0.7", 150.0), start)))
        scene.forget()
        assert scene.find(ImagePicks(), params, None).mask.any() == proposed
        assert scene.find(ImagePicks(), placed, None).mask.any(), "it is said where all images start"
        assert scene.find(ImagePicks(((*LEFT, 6),)), params, None).mask.any()


def test_an_image_that_is_replaced_while_it_is_open_is_read_anew(tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["a.png"])
    with session(folder, tmp_path / "out") as own:
        assert own.image(0, 0)["height"] == SIZE[0]
        before = own.image(0, 0)["picture"]
        (folder / "a.png").write_bytes(encode_mask(disc(LEFT)[:100]))
        with pytest.raises(UsageError, match="since it was opened"):
            own.change(0, 0, 0, "pick", picked(LEFT, status="accepted"), before)
        assert own.image(0, 0)["height"] == 100, "another tab has opened it"
        assert own.image(0, 0)["picture"] != before, "no browser keeps one for the other"
        with pytest.raises(UsageError, match="since it was opened"):
            own.change(0, 0, 0, "pick", picked(LEFT, status="accepted"), before)
        accept(own, 0)
    assert mask_of(tmp_path / "out" / "masks" / "a.png").shape[0] == 100


def test_what_was_drawn_of_one_class_is_not_shown_of_another(tmp_path: Path) -> None:
    folder, imported = draw(tmp_path / "in", ["a.png"]), tmp_path / "out" / "road" / "imported"
    write_image(imported / "a.png", disc(LEFT))
    with session(folder, tmp_path / "out", labels=("road", "kerb")) as own:
        shown = [own.find(kind, 0, OPEN, quick=False)["path"] for kind in (0, 1, 0)]
    assert (shown[0] == shown[2] != "", shown[1]) == (True, "")


def test_masks_stand_wherever_a_folder_is_copied(tmp_path: Path) -> None:
    """The last one was found anew, by the times of files, with the model there is then or with none."""
    folder, out = draw(tmp_path / "in", ["a.png"]), tmp_path / "out"
    with session(folder, out) as own:
        accept(own, 0)
    write_image(out / "masks" / "a.png", disc(RIGHT))
    os.utime(out / "masks" / "a.png", ns=(0, 0))
    session(folder, out).close()
    assert np.array_equal(mask_of(out / "masks" / "a.png"), disc(RIGHT))


def test_a_stroke_on_an_accepted_mask_changes_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another run was begun with, and undoing found that, too; a crash before the mask was written left an empty one."""
    folder, out, run = draw(tmp_path / "in", ["a.png"]), tmp_path / "out", tmp_path / "run"
    write_image(run / "masks" / "a.png", disc(LEFT))
    (run / "timings.csv").write_text("image,status\na.png,ok\n")
    with monkeypatch.context() as patched, session(folder, out, review=str(run)) as own:
        patched.setattr(Project, "keep", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            own.change(0, 0, 0, "pick", OPEN | {"status": "accepted"})
    session(folder, out).close()
    assert np.array_equal(mask_of(out / "masks" / "a.png"), disc(LEFT))
    write_image(run / "masks" / "a.png", disc(RIGHT))
    stroke = {"inside": True, "radius": 2, "points": [[5, 5]]}
    with session(folder, out, review=str(run)) as own:
        own.change(0, 0, 1, "pick", OPEN | {"strokes": [stroke], "status": "accepted"})
        assert (mask_of(out / "masks" / "a.png") ^ disc(LEFT)).sum() < 20
        own.change(0, 0, 2, "undo")
    assert np.array_equal(mask_of(out / "masks" / "a.png"), disc(LEFT))
    for gone in (out / "masks" / "a.png", *(out / "regions").iterdir()):
        gone.unlink()
    with session(folder, out) as own:
        assert own.statuses(0) == {}, "no mask is better than an empty one"


def test_steps_on_accepted_masks_are_undone_whatever_would_be_found_now(tmp_path: Path, monkeypatch) -> None:
    """A newer model, or another run, was followed by a stroke on an accepted mask and by undoing to one."""
    mask, found = tmp_path / "out" / "masks" / "a.png", OpenImage._grown
    stroke = {"inside": True, "radius": 2, "points": [[5, 5]]}
    with session(draw(tmp_path / "in", ["a.png"]), tmp_path / "out") as own:
        for version, place in ((0, LEFT), (2, RIGHT)):  # what two models propose where nothing is picked

            def proposed(*args: object, place: tuple[int, int] = place, **how: object) -> PickedRegion:
                there = args[3] if args[5] is not None else ImagePicks(starts=((*place, 6.0),))
                return found(*args[:3], there, *args[4:], **how)

            monkeypatch.setattr(OpenImage, "_grown", proposed)
            own.forget()
            own.change(0, 0, version, "pick", OPEN | {"status": "accepted"})
            own.forget()
            assert overlap(mask_of(mask), disc(place)) > 0.95
            if version == 0:
                own.change(0, 0, 1, "pick", OPEN)
        own.change(0, 0, 3, "undo")
        own.change(0, 0, 4, "undo")
        assert overlap(mask_of(mask), disc(LEFT)) > 0.95
        monkeypatch.undo()
        own.change(0, 0, 5, "pick", own.image(0, 0)["picked"] | {"strokes": [stroke]})
        assert 0 < (mask_of(mask) ^ disc(LEFT)).sum() < 60
        own.change(0, 0, 6, "undo")
        assert overlap(mask_of(mask), disc(LEFT)) > 0.95


def test_a_model_goes_with_the_masks_it_is_of(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png"]), tmp_path / "out"
    with session(folder, out):
        (out / "model.ffmodel").write_bytes(b"of masks that have gone")
    with session(folder, out) as own:
        assert own.projects[0].params.edges.model is None
    assert not (out / "model.ffmodel").exists()


def test_masks_that_were_not_picked_are_neither_learned_from_nor_replaced(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png"]), tmp_path / "out"
    own = out / "masks" / "b.png"
    own.parent.mkdir(parents=True)
    own.write_bytes(b"drawn by hand")
    with pytest.raises(UsageError, match=r"masks/b\.png was not picked here"):
        session(folder, out)
    own.rename(out / "b.png")
    session(folder, out).close()


def test_the_folder_of_the_images_is_not_marked_as_one_without(tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["a.png", "sub/b.png"])
    for inputs in ([str(folder)], [str(folder / "*.png")]):
        with pytest.raises(UsageError, match="holds the images themselves"):
            Session(inputs, str(folder), load_params())
    with pytest.raises(UsageError, match="in holds the images themselves"):
        Session([str(folder)], str(tmp_path), load_params(), labels=["in"])
    assert sorted(os.listdir(folder)) == ["a.png", "sub"]


def test_a_review_goes_on_with_the_parameters_of_the_run(tmp_path: Path, ffseg_command: Command) -> None:
    draw(tmp_path / "in", ["a.png"])
    ffseg_command("run", str(tmp_path / "in"), "--out", str(tmp_path / "run"), "--set", "edges.sigma=3")
    assert (settings_of(tmp_path / "run"), settings_of(tmp_path / "in")) == (["edges.sigma=3.0"], [])
    told = json.loads((tmp_path / "run" / "run.json").read_text())
    evidence = told | {"parameters": {"edges": {"source": "evidence", "sigma": 3}}}
    (tmp_path / "run" / "run.json").write_text(json.dumps(evidence))
    assert settings_of(tmp_path / "run") == ["edges.sigma=3.0"], "without its maps"
    for section, values in (("method", "mine:run"), ("contour", {"degree": 99}), ("domain", {"mask": "gone.png"})):
        (tmp_path / "run" / "run.json").write_text(json.dumps(told | {"parameters": {section: values}}))
        done = ffseg_command("pick", "--review", str(tmp_path / "run"), "--no-browser")
        assert (done.returncode, done.stderr.rstrip().endswith("--config FILE")) == (2, True)


def test_images_that_would_share_a_mask_are_refused_before_anything_is_picked(tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["a.png", "b.png"])
    (folder / "a.jpg").write_bytes((folder / "a.png").read_bytes())
    with pytest.raises(UsageError, match=r"a\.jpg and .*a\.png would share the output name a"):
        session(folder, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_click_on_a_wire_is_a_disc_that_fits_in_it(tmp_path: Path) -> None:
    """A disc of the usual radius showed more of the ground beside it, and the prior took that along: .41."""
    wire = np.zeros((600, 800), np.uint8)
    cv2.polylines(wire, [np.array([[60, 300], [200, 180], [400, 320], [760, 400]], np.int32)], False, 255, 5)
    image = np.where(wire[..., None] > 0, np.array([40, 60, 200]), np.array([150, 160, 140]))
    image = image + np.random.default_rng(0).normal(0, 4, image.shape)
    (tmp_path / "in").mkdir()
    cv2.imwrite(str(tmp_path / "in" / "a.png"), image.clip(0, 255).astype(np.uint8))
    click = {"starts": [[400, 320, 8]], "status": "accepted"}
    with session(tmp_path / "in", tmp_path / "out") as own:
        own.change(0, 0, 0, "pick", OPEN | click)
        ((*_, radius),) = own.projects[0].track(0).now.starts
        assert 1 <= radius < 3
        assert overlap(mask_of(tmp_path / "out" / "masks" / "a.png"), wire > 0) > 0.95
        own.change(0, 0, 1, "pick", OPEN | {"starts": [[400, 320, 8], [100, 500, 8]], "boxes": [[300, 200, 500, 400]]})
        assert own.projects[0].track(0).now.starts[1] == (100, 500, 8), "what lies beside has room"
    rough = np.random.default_rng(1).integers(60, 190, (120, 160, 3)).astype(np.uint8)
    assert OpenImage(rough).fitted((80, 60, 8), load_params()) == (80, 60, 8), "edges of texture tell of no thing"


def test_classes_have_folders_of_their_own(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png"]), tmp_path / "out"
    with session(folder, out, labels=["left", "right"]) as own:
        for label, place in enumerate((LEFT, RIGHT)):
            own.change(label, 0, 0, "pick", picked(place, status="accepted"))
    assert (out / "classes.txt").read_text() == "left\nright\n"
    for name, place in (("left", LEFT), ("right", RIGHT)):
        assert overlap(mask_of(out / name / "masks" / "a.png"), disc(place)) > 0.95
    for bad in (["a/b"], [".."], ["a", "a"], [""]):
        with pytest.raises(UsageError, match="--labels"):
            session(folder, tmp_path / "bad", labels=bad)


def test_a_click_in_no_box_is_told_in_pixels_of_the_image() -> None:
    found = OpenImage(np.zeros((900, 1200), np.uint8)).find(
        ImagePicks(((900.0, 800.0, 9.0),), boxes=((300.0, 300.0, 700.0, 700.0),)),
        load_params(None, {"contour.balloon": -1}),
        None,
        quick=True,
    )
    assert "the start circle at (900, 800) lies in no box" in found.said


def test_the_picture_shows_the_colour_of_every_pixel() -> None:
    image = np.full((40, 60, 3), 128, np.uint8)
    image[:, ::2] = (40, 40, 200)
    shown = cv2.imdecode(np.frombuffer(OpenImage(image).picture(), np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(shown.astype(int) - image).mean() < 8  # with a colour for four pixels 28


def test_a_reduced_copy_tells_nearly_the_same() -> None:
    y, x = np.mgrid[:1500, :2000]
    image = np.where(np.hypot(x - 900, y - 700) < 400, 190, 60).astype(np.uint8)
    scene, params = OpenImage(image), load_params()
    one = ImagePicks.read(
        picked() | {"starts": [[905, 690, 20]], "strokes": [{"inside": True, "radius": 40, "points": [[1400, 300]]}]}
    )
    quick, whole = scene.find(one, params, None, quick=True), scene.find(one, params, None)
    assert (quick.factor, whole.factor) == (5, 1)
    assert overlap(np.kron(quick.mask, np.ones((5, 5), np.bool_)), whole.mask) > 0.98


def test_areas_in_a_reduced_copy_are_those_of_the_image() -> None:
    """Holes of up to 2000 pixels of the copy were filled while the hand moved: 50,000 of the image."""
    y, x = np.mgrid[:1500, :2000]
    rings = np.hypot(x - 900, y - 700)
    image = np.where((rings < 400) & (rings > 100), 190, 60).astype(np.uint8)
    scene, params = OpenImage(image), load_params(None, {"region.fill_holes": 2000})
    one = ImagePicks(((1100.0, 690.0, 20.0),))
    for quick in (True, False):
        found = scene.find(one, params, None, quick=quick)
        assert not found.mask[round(700 / found.factor), round(900 / found.factor)]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("served")
    names = ["a.png", "<img src=x onerror=alert(1)>.png", "b\n#?%2e.png"]
    with served(draw(folder / "in", names), folder / "out") as running:
        yield running


def test_only_this_page_is_answered(server) -> None:
    own, other = f"{pick_page.HOST}:{server.port}", "http://evil.example"
    assert (ask(server, "")[0], ask(server, "", Host=f"localhost:{server.port}")[0]) == (200, 200)
    assert ask(server, "about", {}, Origin=f"http://{own}")[0] == 200
    for path, headers in (
        ("/", {}),
        ("/about", {}),
        (f"/{server.token[:-1]}/", {}),
        (f"/{server.token}x/", {}),
        ("/\xff/", {}),
        ("", {"Host": f"evil.example:{server.port}"}),  # a name of another site that leads here
        ("", {"Host": pick_page.HOST}),
        ("", {"Origin": other}),
        ("", {"Origin": "null"}),
    ):
        assert ask(server, path.replace("\xff", "%ff"), **headers)[0] == 403, (path, headers)
    for headers in ({"Origin": other}, {"Host": "evil.example"}):
        assert ask(server, "change", {"version": 0, "do": "pick", "picked": picked(LEFT)}, **headers)[0] == 403
    assert ask(server, "change", {"do": "pick"}, Content_Type="text/plain")[0] == 400, "as a form of another site"
    assert ask(server, "image", {"image": 0})[1]["version"] == 0


def test_questions_that_are_none_are_refused_and_name_no_file(server) -> None:
    for path in ("../out/picks.jsonl", "page.py", "image/", "image/9", "image/-1", "image/x", "image/../page.js"):
        assert ask(server, path)[0] in (400, 404), path
    for body in ({"image": 9}, {"image": -1}, {"label": 1}, {"image": "x"}, {"image": float("inf")}, [], 3):
        assert ask(server, "image", body)[0] == 400, body
    assert (ask(server, "find", {})[0], ask(server, "nothing", {})[0]) == (400, 400)
    assert ask(server, "change", {"version": 0, "do": "redoo"})[0] == 400
    assert ask(server, "find", {"picked": {"starts": [[1, 2]]}}) == (
        400,
        {"error": "what was picked cannot be read (a row needs 3 numbers); load the page again"},
    )
    status, found = ask(server, "find", {"picked": picked((500, 500))})
    assert (status, found["path"]) == (200, "")
    assert "outside the image" in found["said"]


def test_a_page_that_leaves_says_nothing_on_the_terminal(server, capfd: pytest.CaptureFixture[str]) -> None:
    before = {*threading.enumerate()}  # of which those of earlier questions may end meanwhile
    with socket.create_connection((pick_page.HOST, server.port)) as page:
        page.sendall(b"GET / HTTP/1.1\r\n")
        page.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # closing resets the connection
        while not (answering := {one for one in threading.enumerate() if one.is_alive()} - before):
            time.sleep(0.01)
    for thread in answering:
        thread.join(20)
        assert not thread.is_alive()
    assert capfd.readouterr().err == ""


def test_the_page_loads_nothing_from_elsewhere_and_names_are_data(server) -> None:
    import http.client

    connection = http.client.HTTPConnection(pick_page.HOST, server.port, timeout=20)
    connection.request("GET", f"/{server.token}/")
    answer = connection.getresponse()
    policy = answer.headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    assert "frame-ancestors 'none'" in policy
    assert answer.headers["Referrer-Policy"] == "no-referrer", "the token is in the address"
    connection.close()
    names = ask(server, "about", {})[1]["images"]
    assert names == ["<img src=x onerror=alert(1)>.png", "a.png", "b\\u000a#?%2e.png"]
    for name in ("page.html", "page.js", "view.js", "page.css"):
        text = (Path(pick_page.__file__).parents[1] / "ffseg" / "picking" / name).read_text()
        assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
        assert "innerHTML" not in text
    assert json.dumps(names).isascii()


FIGURES = {
    "masks": 3, "iou": 0.88, "without": 0.61, "curve": [[1, 0.8], [2, 0.84]], "more": 2, "order": ["c.png", "b.png", "x.png"],
    "searched": True,
}  # fmt: skip


def test_the_page_and_the_run_read_alike(tmp_path: Path, started: Started, monkeypatch: pytest.MonkeyPatch) -> None:
    """A model was learned from values of 16 bits scaled by another range than that it was used with."""
    monkeypatch.chdir(tmp_path)
    folder = draw(tmp_path / "in", ["a.png", "b.png"])
    corner = np.zeros(ffseg.read_image(folder / "a.png").shape[:2], np.bool_)
    corner[:3, :3] = True
    (tmp_path / "corner.png").write_bytes(encode_mask(corner))
    params = load_params(None, {"input.range": [0, 500], "init.background_mask": "corner.png"})
    with Session([str(folder)], "out", params) as own:
        accept(own, 0, 1)
    said = [one for word, one in pairwise(started[0]) if word == "--set"]
    assert (load_params(None, said), load_params(None, said).input.range) == (load_params("out/pick.yaml"), (0, 500))
    assert load_params(None, said).init.background_mask == str(tmp_path / "corner.png")


@pytest.mark.usefixtures("started")
@pytest.mark.parametrize("key", ["domain.mask", "domain.masks"])
def test_the_page_keeps_to_the_domain_as_the_run_does(key: str, tmp_path: Path, monkeypatch) -> None:
    """Copies that follow the hand are smaller than the mask, which was refused; those of each image were passed over."""
    monkeypatch.setattr(scenes, "MAX_PREVIEW_SIDE", 60)
    folder = draw(tmp_path / "in", ["a.png"])
    shape = ffseg.read_image(folder / "a.png").shape[:2]
    mask = np.zeros(shape, np.bool_)
    mask[:, : shape[1] // 3] = True
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "a.png").write_bytes(encode_mask(mask))
    named = tmp_path / "own" / ("a.png" if key == "domain.mask" else "")
    with Session([str(folder)], str(tmp_path / "out"), load_params(None, {key: str(named)})) as own:
        for quick in (False, True):
            found = own._found(own.projects[0], 0, ImagePicks.read(picked(LEFT)), quick=quick)
            assert found.said == "" or found.mask.any(), found.said
            assert found.mask.any()
            assert not found.mask[:, found.mask.shape[1] // 3 + 1 :].any()


@pytest.mark.usefixtures("started")
def test_images_that_were_replaced_after_they_were_accepted_are_named(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png", "c.png"]), tmp_path / "out"
    with session(folder, out) as own:
        accept(own, 0, 1)
        assert own.changed() == []
    later = (out / "masks" / "b.png").stat().st_mtime_ns + 10**9
    for name in ("b.png", "c.png"):
        os.utime(folder / name, ns=(later, later))
    with session(folder, out) as own:
        assert own.changed() == ["b.png"]
    for name in ("a.png", "c.png"):  # by an older file, as one that was moved there; nothing was picked in c.png
        (folder / name).write_bytes((folder / name).read_bytes() + b" ")
        os.utime(folder / name, ns=(0, 0))
    with session(folder, out) as own:
        assert own.changed() == ["a.png", "b.png"]


def test_what_was_picked_in_a_film_is_followed(tmp_path: Path, ffseg_command: Command, started: Started) -> None:
    film = write_film(tmp_path / "film.mp4", pictures(4))
    with session(film, tmp_path / "out") as own:
        assert "--steady" not in own.projects[0].arguments(), "there is nothing to follow"
        own.change(0, 0, 0, "pick", picked((38, 30)))
        arguments = own.projects[0].arguments()
        assert ("--steady" in arguments, started) == (True, [])
    assert "without a row" not in ffseg_command(*arguments, code=0).stderr
    arguments.remove("--steady")
    assert "; with --steady they follow the frame before" in ffseg_command(*arguments, code=0).stderr


def test_what_was_learned_is_used_where_it_helps_and_orders_the_images(tmp_path: Path, started: Started) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png", "c.png", "d.png"]), tmp_path / "out"
    with session(folder, out) as own:
        work = own._work[0]
        for index in (0, 3):
            assert not started
            own.change(0, index, 0, "pick", picked(LEFT, status="accepted"))
            assert "--starts" in own.projects[0].arguments(), "images without a row start where all do"
        assert started[0][:2] == ["learn", str(folder)]
        assert own.following(0, 0) == 1, "the next in the folder"
        new = Path(started[0][started[0].index("--out") + 1])
        new.write_bytes(A_MODEL)
        assert "--quick" in started[0], "a model first, figures afterwards"
        work._learned(0, json.dumps(FIGURES | {"iou": None, "without": None, "curve": []}), "")
        assert own.news(0, 0)["lines"][1] == "learned from 3 masks, now measured on each left out"
        assert own.projects[0].params.edges.model == str(out / "model.ffmodel"), "it need not be measured to be used"
        assert started[1:] == [[word for word in started[0] if word != "--quick"]]
        new.write_bytes(A_MODEL)
        work._learned(0, json.dumps(FIGURES), "")
        assert len(started) == 2
        assert own.news(0, 0)["lines"][1] == "3 masks: .88 expected on the rest; one more may raise it by about .04"
        assert own.following(0, 0) == 2, "the one it is least sure of"
        assert (own.following(0, 2), own.following(0, 1)) == (1, 2), "the next in line, and round"
        assert own.projects[0].params.edges.model == str(out / "model.ffmodel")
        assert f"model: {out}/model.ffmodel" in (out / "pick.yaml").read_text()
        new.write_bytes(A_MODEL)
        work._learned(0, json.dumps(FIGURES | {"iou": 0.5}), "")
        assert "it is not used" in own.news(0, 0)["lines"][1]
        assert own.projects[0].params.edges.model is None
        (out / "learning.ffmodel").write_bytes(A_MODEL)
        work._learned(0, json.dumps(FIGURES), "")
    with session(folder, out) as own:
        assert own.news(0, 0)["lines"][1] == "3 masks: .88 expected on the rest; one more may raise it by about .04"
        assert own.following(0, 0) == 2, "the order is kept"
        assert len(started) == 2, "nothing is learned anew"
        work = own._work[0]
        work._learned(2, "", "ffseg: error: ffseg learn needs LightGBM; install ffseg[learn]\n")
        assert own.news(0, 0)["lines"][1] == "nothing was learned: ffseg learn needs LightGBM; install ffseg[learn]"
        work._learned(0, json.dumps(FIGURES), "")  # of a model that is not there
        assert own.news(0, 0)["lines"][1].startswith("what was learned cannot be kept: ")


def test_one_mask_of_many_things_is_learned_from(tmp_path: Path, started: Started) -> None:
    """Nothing can be left out of one: a second tells how well it does."""
    with session(draw(tmp_path / "in", ["a.png", "b.png", "c.png"]), tmp_path / "out") as own:
        own.change(0, 0, 0, "pick", picked(LEFT, status="accepted"))
        assert (started, own.news(0, 0)["lines"][1]) == ([], "1 more accepted and a model is learned from them")
        own.change(0, 0, 1, "pick", picked(LEFT, RIGHT, status="accepted"))
        assert "--quick" in started[0]
        assert own.news(0, 0)["lines"][1] == "learning from 1 mask"
        Path(started[0][started[0].index("--out") + 1]).write_bytes(A_MODEL)
        own._work[0]._learned(0, json.dumps(FIGURES | {"masks": 1, "iou": None, "without": None, "curve": []}), "")
        assert own.news(0, 0)["lines"][1] == "learned from 1 mask, how well it does shows with the next"
        assert (own.projects[0].model != "", len(started)) == (True, 1)
    with session(tmp_path / "in", tmp_path / "out") as own:
        assert len(started) == 1, "what was learned is taken up"
        own.change(0, 1, 0, "pick", picked(LEFT, status="accepted"))
        Path(started[1][started[1].index("--out") + 1]).write_bytes(A_MODEL)
        own._work[0]._learned(0, json.dumps(FIGURES | {"iou": None, "without": None, "curve": []}), "")
        assert ["--quick" in words for words in started] == [True, True, False]


@pytest.mark.parametrize("helps", [False, True])
def test_what_finds_no_starts_is_used_where_it_helps(tmp_path: Path, started: Started, helps: bool) -> None:
    with session(draw(tmp_path / "in", ["a.png", "b.png", "c.png"]), tmp_path / "out") as own:
        accept(own, 0, 1)
        Path(started[0][started[0].index("--out") + 1]).write_bytes(A_MODEL)
        own._work[0]._learned(0, json.dumps(FIGURES | {"searched": False, "met": 0.2, "helps": helps}), "")
        line, model = own.news(0, 0)["lines"][1], own.projects[0].params.edges.model
        assert line.startswith("3 masks: .88 expected from a click in each; ")
        assert ("it is not used" in line, model is None) == (not helps,) * 2
        (tmp_path / "out" / "learning.ffmodel").write_bytes(to_bytes(Model(stump("likeness", 1.0))))
        own._work[0]._learned(0, json.dumps(FIGURES | {"iou": None, "without": None, "curve": []}), "")
        assert own.projects[0].params.edges.model == model, "the next is used when it is measured"
        assert model is None or Path(model).read_bytes() == A_MODEL


def test_an_accepted_image_shows_the_mask_that_was_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever a later model would find; and nothing is accepted again whose region is neither kept nor found."""
    found = OpenImage.find
    with session(draw(tmp_path / "in", ["a.png"]), tmp_path / "out") as own:
        accept(own, 0)
        kept = own.find(0, 0, own.image(0, 0)["picked"], quick=False)
        monkeypatch.setattr(
            OpenImage, "find", lambda self, picked, *rest, **how: found(self, ImagePicks(), *rest, **how)
        )
        assert own.find(0, 0, own.image(0, 0)["picked"], quick=False)["path"] == kept["path"] != ""
        own.change(0, 0, 1, "undo")
        next((tmp_path / "out" / "regions").iterdir()).unlink()
        with pytest.raises(UsageError, match="a mask needs pixels"):
            own.change(0, 0, 2, "redo")
        assert own.statuses(0) == {}


def test_what_is_being_learned_when_the_program_is_killed_is_learned_anew(tmp_path: Path, started: Started) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png", "c.png"]), tmp_path / "out"
    with session(folder, out) as own:
        accept(own, 0, 1)
        (out / "learning.ffmodel").write_bytes(A_MODEL)
        own._work[0]._learned(0, json.dumps(FIGURES | {"iou": None}), "")
        assert len(started) == 2, "it is measured"
    with session(folder, out) as own:
        assert own.news(0, 0)["lines"][1] == "learned from 3 masks, now measured on each left out"
        assert ("--quick" in started[2], len(started)) == (False, 3)
        (out / "model.ffmodel").unlink()
        accept(own, 2)
    with session(folder, out) as own:
        assert own.news(0, 0)["lines"][1] == "learning from 3 masks"
        assert ("--quick" in started[4], len(started)) == (True, 5)


def test_a_model_that_cannot_be_asked_is_learned_anew(tmp_path: Path, started: Started) -> None:
    """One of another version: no image could be looked at until another one was accepted."""
    folder, out = draw(tmp_path / "in", ["a.png", "b.png", "c.png"]), tmp_path / "out"
    with session(folder, out) as own:
        accept(own, 0, 1)
        (out / "learning.ffmodel").write_bytes(A_MODEL)
        own._work[0]._learned(0, json.dumps(FIGURES), "")
    before = len(started)
    (out / "model.ffmodel").write_bytes(A_MODEL.replace(b'"likeness"', b'"unlikely"'))
    with session(folder, out) as own:
        assert own.projects[0].params.edges.model is None
        assert (own.news(0, 0)["lines"][1], len(started)) == ("learning from 2 masks", before + 1)


def test_who_asks_for_a_region_that_is_being_found_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    grown: list[object] = []
    begun, go_on = threading.Event(), threading.Event()

    def grow(self: OpenImage, image: np.ndarray, factor: float, *_of: object, **_how: object) -> PickedRegion:
        grown.append(self)
        begun.set()
        assert go_on.wait(60)
        return PickedRegion(disc(LEFT), (), factor)

    monkeypatch.setattr(OpenImage, "_grown", grow)
    scene, click = OpenImage(np.zeros(SIZE, np.uint8)), ImagePicks(((*LEFT, 6),))
    found: list[PickedRegion] = []
    asking = [
        threading.Thread(target=lambda one=one: found.append(scene.find(one, load_params(), None)))
        for one in (click, dataclasses.replace(click, status="accepted"))
    ]
    asking[0].start()
    assert begun.wait(60)
    asking[1].start()
    go_on.set()
    for thread in asking:
        thread.join(60)
    assert (len(grown), found[0] is found[1]) == (1, True)


def test_what_is_learned_behind_writes_no_file_while_a_step_is_kept(tmp_path: Path) -> None:
    with session(draw(tmp_path / "in", ["a.png"]), tmp_path / "out") as own:
        behind = threading.Thread(target=own._work[0]._use, kwargs={"learned": False})
        with own._changing:
            behind.start()
            behind.join(0.2)
            assert behind.is_alive()
        behind.join(60)
        assert not behind.is_alive()


def test_a_command_behind_is_ended_by_a_newer_one() -> None:
    heard: list[tuple[int, str]] = []
    done = threading.Event()
    behind = Background(lambda code, out, _err: (heard.append((code, out)), done.set()))
    behind.start(["samples", "/dev/null/none"])
    behind.start(["--version"])
    assert done.wait(120)
    assert (len(heard), heard[0][0]) == (1, 0)
    assert heard[0][1].startswith("ffseg ")
    assert not behind.running


def test_the_folder_is_run_behind_and_its_masks_are_shown(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "b.png"]), tmp_path / "out"
    with session(folder, out) as own:
        for index, place in enumerate((LEFT, RIGHT)):
            own.change(0, index, 0, "pick", picked(place))
        own.run(0)
        deadline = time.monotonic() + 60
        while own.news(0, 0)["lines"][0] == "running 2 images" and time.monotonic() < deadline:
            time.sleep(0.05)
        own._work[0]._learned(2, "", "ffseg: error: too few\n")
        assert own.news(0, 0)["lines"] == ["the folder is done: 2 images", "nothing was learned: too few"]
        own.change(0, 0, 1, "pick", OPEN)
        assert own.find(0, 0, OPEN, quick=False)["source"] == "run"
        assert overlap(own._found(own.projects[0], 0, ImagePicks()).mask, disc(LEFT)) > 0.95


def test_a_notebook_gets_the_page_in_a_frame_and_what_was_picked(tmp_path: Path) -> None:
    image = np.full(pick_page.SIZE, 60, np.uint8)
    image[disc(LEFT)] = 180
    with ffseg.pick([image, image], {"region.islands": False}, out=tmp_path / "out") as opened:
        assert opened._repr_html_().startswith(f'<iframe src="{opened.address}" ')
        server = opened._server
        assert "frame-ancestors http://localhost:*" in server.policy
        for index, status in enumerate(("accepted", "open")):
            one = {"image": index, "version": 0, "do": "pick", "picked": picked(LEFT, status=status)}
            assert ask(server, "change", one)[0] == 200
        assert [name for name, one in opened.starts().items() if one["starts"] == ((*LEFT, 6),)] == ["0.png", "1.png"]
        assert list(opened.masks()) == ["0.png"]
        assert overlap(opened.masks()["0.png"], disc(LEFT)) > 0.95
    opened.close()
    with ffseg.pick(tmp_path / "out" / "images", out=tmp_path / "out") as again:
        assert list(again.masks()) == ["0.png"]
        with pytest.raises(UsageError, match="another ffseg run"):
            ffseg.pick(tmp_path / "out" / "images", out=tmp_path / "out")
    with ffseg.pick(image, out=tmp_path / "out") as fewer:
        assert len(fewer._session.sources) == 1
    with ffseg.pick(image, out=tmp_path / "named", labels="road") as named:
        assert named._session.labels == ("road",)
        with pytest.raises(UsageError, match="label: -1 is the place of no class"):
            named.starts(-1)
    with pytest.raises(ffseg.ParameterError, match="evidence needs a map of each image"):
        ffseg.pick(image, {"edges.source": "evidence"}, out=tmp_path / "none")
    with pytest.raises(UsageError, match="images is of type NoneType"):
        ffseg.pick(None)
    with pytest.raises(ffseg.SegmentationError, match="the image is None"):
        ffseg.pick([None], out=tmp_path / "out")
    with pytest.raises(UsageError, match="is another array"):
        ffseg.pick(255 - image, out=tmp_path / "out")
    with pytest.raises(ffseg.ParameterError, match=r"init\.circles is set too"):
        ffseg.pick([image], {"init.circles": [[40, 40, 5]]}, out=tmp_path / "out")
    journal, kept = tmp_path / "out" / "picks.jsonl", (tmp_path / "out" / "picks.jsonl").read_bytes()
    journal.write_bytes(b"{}\n")
    with pytest.raises(OutputError, match="is no step"):
        ffseg.pick([image], out=tmp_path / "out")
    journal.write_bytes(kept)
    ffseg.pick([image], out=tmp_path / "out").close()


ENDS = """
import http.client, json, threading, time
import numpy as np
import ffseg

picking = ffseg.pick([np.random.default_rng(0).integers(0, 255, (1500, 2000, 3), np.uint8)], out="out")
host, _, path = picking.address.removeprefix("http://").partition("/")

def ask(start):
    for x in range(start, 2000):
        connection = http.client.HTTPConnection(host)
        starts = {"starts": [[x, 400, 20]], "nots": [], "boxes": [], "strokes": []}
        connection.request("POST", f"/{path}find", json.dumps({"picked": starts}), {"Content-Type": "application/json"})
        connection.getresponse().read()

for start in (300, 500, 700):
    threading.Thread(target=ask, args=(start,), daemon=True).start()
time.sleep(1.5)
"""


def test_a_program_that_ends_while_the_page_works_ends_well(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", ENDS], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (
        done.returncode,
        [line for line in done.stderr.splitlines() if "terminate" in line or "nanobind" in line],
    ) == (0, [])


def test_a_server_closes_when_the_last_answer_is_found_and_begins_no_other(tmp_path: Path, monkeypatch) -> None:
    begun, go, closed = threading.Event(), threading.Event(), threading.Event()
    monkeypatch.setattr(Session, "about", lambda _: {"answer": (begun.set(), go.wait(20))})
    with session(draw(tmp_path / "in", ["a.png"]), tmp_path / "out") as own:
        server = Server(own)
        server.begin()
        asking = threading.Thread(target=ask, args=(server, "about", {}))
        asking.start()
        assert begun.wait(20)
        server.shutdown()
        assert server.busy
        closing = threading.Thread(target=lambda: (server.server_close(), closed.set()))
        closing.start()
        assert not closed.wait(0.2)
        go.set()
        assert closed.wait(20)
        assert not server.busy
        with pytest.raises(ConnectionResetError), server.working():
            pass


@pytest.mark.usefixtures("started")
def test_labels_of_an_image_that_cannot_be_read_keep_no_other_from_being_taken(tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["b.png"])
    (folder / "a.png").write_text("broken")
    boxes = [{"image_id": name, "bbox": [20, 20, 30, 30]} for name in ("a.png", "b.png")]
    images = [{"id": one["image_id"], "file_name": one["image_id"]} for one in boxes]
    (tmp_path / "coco.json").write_text(json.dumps({"images": images, "annotations": boxes}))
    with session(folder, tmp_path / "out") as own:
        assert (own.take(read_labels(tmp_path / "coco.json")), own.statuses(0)) == ((1, []), {1: "accepted"})


@pytest.mark.usefixtures("started")
@pytest.mark.parametrize("thin", [[20.6, 20, 0.3, 30], [500, 500, 9, 9], [-9, -9, 999, 999]])
def test_labels_that_hold_no_pixel_or_all_are_named(thin: list[float], tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["a.png", "b.png", "c.png"])
    boxes = [("a.png", thin), ("b.png", [20, 20, 30, 30]), ("b.png", thin), ("c.png", [20, 20, 30, 30])]
    images = [{"id": name, "file_name": name} for name in ("a.png", "b.png", "c.png")]
    document = {"images": images, "annotations": [{"image_id": name, "bbox": box} for name, box in boxes]}
    (tmp_path / "coco.json").write_text(json.dumps(document))
    with session(folder, tmp_path / "out") as own:
        assert own.take(read_labels(tmp_path / "coco.json"))[1] == ["a.png", "b.png"]


def test_labels_that_are_refused_have_changed_nothing(tmp_path: Path) -> None:
    folder = draw(tmp_path / "in", ["a.png", "b.png"])
    boxes = [{"image_id": name, "bbox": [20, 20, 30, 30]} for name in ("a.png", "b.png")]
    images = [
        {"id": f"{name}.png", "file_name": f"{name}.png", "height": high, "width": 160}
        for name, high in (("a", 120), ("b", 9))
    ]
    (tmp_path / "coco.json").write_text(json.dumps({"images": images, "annotations": boxes}))
    with session(folder, tmp_path / "out") as own:
        with pytest.raises(UsageError, match=r"b\.png were drawn on 160x9"):
            own.take(read_labels(tmp_path / "coco.json"))
        assert own.statuses(0) == {}


def test_labels_come_from_other_programs_and_go_back(tmp_path: Path) -> None:
    folder, out = draw(tmp_path / "in", ["a.png", "sub/b.png"]), tmp_path / "out"
    with session(folder, out) as own:
        accept(own, 0)
    exported = json.loads((out / "labels" / "a.json").read_text())
    assert (out / "labels" / exported["imagePath"]).resolve() == folder / "a.png"
    drawn = read_labels(out / "labels")
    with session(folder, tmp_path / "second") as own:
        own.change(0, 1, 0, "pick", picked(RIGHT))
        assert own.take(drawn) == (1, [])
        assert own.take(drawn) == (0, []), "nothing is doubled"
        assert own.statuses(0) == {0: "accepted"}
        eraser = {"inside": False, "radius": 40, "points": [[25, 60]]}
        own.change(0, 0, 1, "pick", OPEN | {"strokes": [eraser], "status": "accepted"})
        mask = mask_of(tmp_path / "second" / "masks" / "a.png")
        assert 0 < mask.sum() < 0.7 * disc(LEFT).sum()
        own.change(0, 0, 2, "undo")
    assert (tmp_path / "second" / "masks" / "a.png").read_bytes() == (out / "masks" / "a.png").read_bytes()
    with session(folder, out) as own:
        own.change(0, 0, 1, "undo")
    assert not (out / "labels" / "a.json").exists()
