"""Inputs: files, folders, patterns; natural order; what is left out; the plan and what it refuses."""

import os
import time
from pathlib import Path

import pytest

from ffseg.batch.plan.beside import find_domains, find_evidence
from ffseg.batch.plan.discover import discover
from ffseg.batch.plan.jobs import make_plan, prepare_output
from ffseg.errors import OutputError, UsageError


def _touch(folder: Path, *names: str) -> None:
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def _names(*inputs: Path | str) -> list[str]:
    return [source.name for source in discover([str(text) for text in inputs])]


def test_folder_is_walked_in_natural_order(tmp_path: Path) -> None:
    _touch(tmp_path, "a10.png", "a2.png", "b/z1.JPG", "b/a/x.tif", "notes.txt", "a2.csv")
    assert _names(tmp_path) == ["a2.png", "a10.png", "b/a/x.tif", "b/z1.JPG"]


def test_hidden_files_temporaries_and_outputs_are_left_out(tmp_path: Path) -> None:
    _touch(tmp_path, "a.png", ".b.png", ".git/c.png", ".ffseg-1-2.tmp", "masks/kept.png")
    _touch(tmp_path, "out/.ffseg/lock", "out/masks/a.png", "out/overlays/b/a.png", "out/contours/a.png", "out/own.png")
    assert _names(tmp_path) == ["a.png", "masks/kept.png", "out/own.png"]
    assert _names(tmp_path / "**" / "*.png") == ["a.png", "masks/kept.png", "out/own.png"]


def test_folders_marked_to_be_skipped_are_inputs_only_by_name(tmp_path: Path) -> None:
    _touch(tmp_path, "a.png", "pair/.ffseg-skip", "pair/1.png", "pair/below/2.png", "pair/truth/.ffseg-skip")
    _touch(tmp_path, "pair/truth/1.png")
    assert (_names(tmp_path), _names(tmp_path / "pair")) == (["a.png"], ["1.png", "below/2.png"])
    assert _names(tmp_path / "p*") == ["pair/1.png", "pair/below/2.png"]
    assert _names(tmp_path / "pair" / "truth") == ["1.png"]


def test_patterns_are_relative_to_their_fixed_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _touch(tmp_path, "run1/left/a.png", "run2/left/a.png", "run2/right/b.png")
    assert _names(tmp_path / "run*" / "left") == ["run1/left/a.png", "run2/left/a.png"]
    monkeypatch.chdir(tmp_path)
    assert _names("run2/*/[ab].png") == ["left/a.png", "right/b.png"]
    assert _names("*/left/*.png") == ["run1/left/a.png", "run2/left/a.png"]


@pytest.mark.parametrize("pattern", ["in/*/../../other/*.png", "in/**/../../other/a.png", "in/*/../a.png"])
def test_patterns_that_lead_upward_are_refused(pattern: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _touch(tmp_path, "in/sub/a.png", "in/a.png", "other/a.png")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=r"'\.\.' behind a wildcard"):
        discover([pattern])
    assert _names("in/../other/*.png") == ["a.png"]


def test_named_file_needs_no_suffix_and_brackets_in_names_are_no_pattern(tmp_path: Path) -> None:
    _touch(tmp_path, "scan", "a[1].png")
    assert _names(tmp_path / "scan", tmp_path / "a[1].png") == ["scan", "a[1].png"]


def test_link_loops_end_and_real_folders_come_first(tmp_path: Path) -> None:
    _touch(tmp_path, "z/a.png")
    (tmp_path / "z" / "up").symlink_to(tmp_path)
    (tmp_path / "b").symlink_to(tmp_path / "z")
    assert _names(tmp_path) == ["z/a.png"]


def test_same_file_twice_is_one_input(tmp_path: Path) -> None:
    _touch(tmp_path, "a.png")
    assert _names(tmp_path, tmp_path / "a.png", tmp_path / "*.png") == ["a.png"]


@pytest.mark.parametrize("text", ["nowhere.png", "nowhere/*.png", "empty"])
def test_inputs_without_an_image_are_an_error(text: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match=text.split("/", maxsplit=1)[0]):
        discover([str(tmp_path / text)])


@pytest.mark.skipif(os.geteuid() == 0, reason="root lists every folder")
def test_folder_that_cannot_be_listed_is_a_failed_row(tmp_path: Path) -> None:
    _touch(tmp_path, "shut/a.png", "b.png")
    (tmp_path / "shut").chmod(0)
    problems = {source.name: source.problem for source in discover([str(tmp_path)])}
    (tmp_path / "shut").chmod(0o700)
    assert problems["shut"].startswith("unreadable: ")
    assert problems["b.png"] == ""


def test_output_that_is_a_folder_of_others_is_refused(tmp_path: Path) -> None:
    _touch(tmp_path, "a.jpg", "a.png/b.jpg")
    with pytest.raises(UsageError, match="also the folder"):
        make_plan([str(tmp_path)], str(tmp_path / "out"))


def test_outputs_over_inputs_are_refused_even_through_links(tmp_path: Path) -> None:
    _touch(tmp_path, "masks/a.png")
    (tmp_path / "link").symlink_to(tmp_path)
    for out in (tmp_path, tmp_path / "link"):
        with pytest.raises(UsageError, match="replace an input"):
            make_plan([str(tmp_path / "masks" / "a.png")], str(out))


def test_truths_beside_their_images_are_no_inputs(tmp_path: Path) -> None:
    _touch(tmp_path, "a.png", "a_truth.png", "sub/b.jpg")
    _touch(tmp_path / "t", "sub/b.png")
    plan = make_plan([str(tmp_path / "a.png"), str(tmp_path / "a_truth.png")], str(tmp_path / "o"), truth=str(tmp_path))
    assert [(job.source.name, os.path.basename(job.truth)) for job in plan.jobs] == [("a.png", "a_truth.png")]
    plan = make_plan([str(tmp_path / "sub")], str(tmp_path / "o"), truth=str(tmp_path / "t" / "sub"))
    assert plan.jobs[0].truth.endswith("t/sub/b.png")
    with pytest.raises(UsageError, match="no image has a mask"):
        make_plan([str(tmp_path / "sub")], str(tmp_path / "o"), truth=str(tmp_path / "t"))


def test_two_files_that_could_belong_to_an_image_are_refused(tmp_path: Path) -> None:
    _touch(tmp_path / "in", "a.jpg", "a.png")
    _touch(tmp_path / "t", "a.png", "a_truth.png")
    _touch(tmp_path / "maps", "a.npy", "a.png")
    one = str(tmp_path / "in" / "a.jpg")
    said = r"--truth: .*/t holds a_truth\.png and a\.png, each .* belong to a\.jpg; leave one"
    with pytest.raises(UsageError, match=said):
        make_plan([one], str(tmp_path / "o"), truth=str(tmp_path / "t"))
    with pytest.raises(UsageError, match=r"--evidence: .* holds a\.npy and a\.png"):
        find_evidence(discover([one]), str(tmp_path / "maps"))
    with pytest.raises(UsageError, match=r"domain\.masks: .* holds a\.jpg and a\.png"):
        find_domains(discover([str(tmp_path / "t" / "a.png")]), str(tmp_path / "in"))
    with pytest.raises(UsageError, match=r"a\.png and a\.jpg could each be the mask of the other"):
        make_plan([str(tmp_path / "in")], str(tmp_path / "o"), truth=str(tmp_path / "in"))
    _touch(tmp_path / "in", "a_truth.png")  # beside an image of that name it is not in doubt
    plan = make_plan([str(tmp_path / "in")], str(tmp_path / "o"), truth=str(tmp_path / "in"), keep_suffix=True)
    assert [(job.source.name, job.truth[-11:]) for job in plan.jobs] == [
        (f"a.{end}", "a_truth.png") for end in ("jpg", "png")
    ]


@pytest.mark.parametrize("blocker", ["out", "out/masks", "out/.ffseg"])
def test_output_that_cannot_be_made_is_named(blocker: str, tmp_path: Path) -> None:
    _touch(tmp_path, "in/a.png", blocker)
    plan = make_plan([str(tmp_path / "in")], str(tmp_path / "out"))
    with pytest.raises(OutputError, match=blocker):
        prepare_output(plan, os.path.join(plan.out, ".ffseg"))


def test_planning_takes_work_in_proportion_to_the_images(tmp_path: Path) -> None:
    used = []
    for count in (1000, 10_000):
        folders = [tmp_path / str(count) / f"f{number}" for number in range(20)]
        for folder in folders:
            folder.mkdir(parents=True)
        for number in range(count):
            (folders[number % 20] / f"image{number}.png").touch()
        started = time.process_time()
        plan = make_plan([str(tmp_path / str(count))], str(tmp_path / "out"))
        used.append(time.process_time() - started)
    assert (len(plan.jobs), [job.source.name for job in plan.jobs[:2]]) == (10_000, ["f0/image0.png", "f0/image20.png"])
    assert used[1] < 40 * used[0]  # ten times the images; a hundred where each is compared with all


def test_a_folder_of_films_alone_says_how_they_are_named(tmp_path: Path) -> None:
    _touch(tmp_path, "in/a.mp4")
    with pytest.raises(UsageError, match="name a film by its file"):
        make_plan([str(tmp_path / "in")], str(tmp_path / "out"))
