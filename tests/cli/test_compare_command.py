"""``ffseg compare``: exit codes, sentences, and what is on disk."""

import json
from pathlib import Path

import pytest
from commands import Command

from tests.discs import bright_disc, write_case
from tests.masks import write_image

DISC = bright_disc((90, 120), (60, 45), 30)


def test_a_comparison_and_its_json(tmp_path: Path, ffseg_command: Command) -> None:
    write_case(tmp_path)
    out = tmp_path / "out"
    given = ("compare", tmp_path / "disc.png", "--out", out, "--truth", tmp_path / "truth", "--set", "init.radius=10")
    gates = ("--min-iou", "0.9", "--min-iou", "levelset=0.95")
    done = ffseg_command(*given, "--methods", "freeform,levelset", "--json", *gates, code=0)
    document = json.loads(done.stdout)
    assert ([row["method"] for row in document["rows"]], document["missed"]) == (["freeform", "levelset"], [])
    assert sorted(path.name for path in out.iterdir()) == ["compare.csv", "compare.md", "panels"]
    assert "disc.png: levelset ok" in done.stderr


def test_a_missed_gate_is_exit_4(tmp_path: Path, ffseg_command: Command) -> None:
    write_case(tmp_path)
    given = ("compare", tmp_path / "disc.png", "--out", tmp_path / "out", "--truth", tmp_path / "truth")
    loose = ("--methods", "levelset", "--set", "init.radius=10", "--set", "levelset.settle=0")
    assert "levelset has IoU" in ffseg_command(*given, *loose, "--min-iou", "0.99", code=4).stderr
    assert (tmp_path / "out" / "compare.csv").exists()


def test_the_terminal_gets_a_summary_of_each_method(tmp_path: Path, ffseg_command: Command) -> None:
    samples = Path(__file__).resolve().parents[2] / "samples"
    methods = ("--methods", "freeform,cv_edges")
    done = ffseg_command("compare", samples, "--out", tmp_path / "out", *methods, "--truth", samples / "truth")
    head, first, second, where = done.stdout.splitlines()
    assert " ".join(head.split()) == "method images median evolution ms median total ms mean IoU lowest IoU best on"
    assert (first.split()[:3], second.split()[:2]) == (["freeform", "(FF)", "3"], ["cv_edges", "3"])
    assert where == f"every image: {tmp_path / 'out' / 'compare.md'}"
    assert "IoU" not in ffseg_command("compare", samples / "toy.png", "--out", tmp_path / "alone", *methods).stdout


def test_panels_that_belong_to_no_row_are_removed(tmp_path: Path, ffseg_command: Command) -> None:
    """Those of images left out, or no longer to be read, stayed beside the new table; files of others do stay."""
    folder, panels = tmp_path / "in", tmp_path / "out" / "panels"
    for name in ("a.png", "b.png", "sub/c.png"):
        write_image(folder / name, DISC)
    command = (folder, "--out", tmp_path / "out", "--methods", "cv_edges", "--set", "init.radius=8", "-q")
    ffseg_command("compare", *command, code=0)
    (panels / "mine.png").write_bytes(b"mine")
    (folder / "a.png").write_text("no image")
    (folder / "sub" / "c.png").unlink()
    ffseg_command("compare", *command, code=3)
    assert sorted(path.name for path in panels.rglob("*.png")) == ["b.png", "mine.png"]


def test_panels_inside_the_input_are_no_images(tmp_path: Path, ffseg_command: Command) -> None:
    """The second comparison was refused, since a panel was an input that it would replace."""
    folder = tmp_path / "in"
    write_image(folder / "a.png", DISC)
    command = (folder, "--out", folder / "cmp", "--methods", "cv_edges", "--set", "init.radius=8", "-q")
    assert [ffseg_command("compare", *command).returncode for _ in range(2)] == [0, 0]
    planned = ffseg_command("run", folder, "--out", tmp_path / "out", "--dry-run").stdout
    assert len(planned.splitlines()) == 1


def test_an_unwritable_output_is_exit_3_once_something_was_run(tmp_path: Path, ffseg_command: Command) -> None:
    """It was 2, which says that nothing was run; as it still does of a folder that cannot be made."""
    write_case(tmp_path)
    write_case(tmp_path / "in" / "sub")
    command = (tmp_path / "in", "--methods", "cv_edges", "--set", "init.radius=8", "-q", "--out")
    (tmp_path / "out" / "panels").mkdir(parents=True)
    (tmp_path / "out" / "panels" / "sub").write_text("in the way")
    assert "panels/sub cannot be made" in ffseg_command("compare", *command, tmp_path / "out", code=3).stderr
    assert (tmp_path / "out" / "compare.csv").exists()
    ffseg_command("compare", *command, tmp_path / "disc.png", code=2)


@pytest.mark.parametrize("name", ["compare.csv", "compare.md", "compare.jsonl", "panels/disc.png"])
def test_what_no_comparison_made_is_not_replaced(name: str, tmp_path: Path, ffseg_command: Command) -> None:
    """It was replaced, and a compare.jsonl removed, without a word."""
    write_case(tmp_path)
    path = tmp_path / "out" / name
    path.parent.mkdir(parents=True)
    path.write_text("image\nmine\n")
    done = ffseg_command("compare", tmp_path / "disc.png", "--out", tmp_path / "out", "--methods", "cv_edges", code=2)
    assert f"{path} exists and no comparison made it; choose another folder" in done.stderr
    assert path.read_text() == "image\nmine\n"
    assert [file for file in (tmp_path / "out").rglob("*") if file.is_file()] == [path]
