"""What a command refuses before it does anything."""

import os
import shutil
from pathlib import Path

import pytest
from commands import Command

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
USAGE = {
    "nan seconds": (["--timeout", "nan"], "'--timeout': nan is not a number"),
    "more seconds than any": (["--timeout", "1e300"], "'--timeout'"),
    "more memory than any": (["--memory", "9" * 20], "'--memory'"),
    "thresholds no gradient has": (["--set", "edges.canny=[1e300,1e300]"], "is not a number from 0 to 10000"),
    "no such method": (["--set", "method=freefrm"], "did you mean 'freeform'?"),
    "no such mask": (["--set", "domain.mask=nofile.png"], "domain.mask: there is no file nofile.png"),
    "no such start": (["--set", "init.mask=nofile.png"], "init.mask: there is no file nofile.png"),
    "a balloon that moves nothing": (["--set", "contour.balloon=0"], "contour.balloon: 0 moves no free-form contour"),
    "a pipe for a model": (
        ["--set", "edges.model=/dev/zero"],
        "edges.model: /dev/zero is not a file that can be read as a model",
    ),
    "a start beyond all images": (["--set", "init.radius=1e6"], "is not a number above 0 and up to 100000"),
    "a device for a mask": (["--set", "domain.mask=/dev/zero"], "domain.mask: /dev/zero is not a file"),
    "no such key": (["--set", "contour.degre=2"], "did you mean 'contour.degree'?"),
    "a degree of nine": (["--set", "contour.degree=9"], "contour.degree: 9 is not an integer from 1 to 6"),
    "no such truth": (["--truth", "nowhere"], "nowhere"),
    "no such configuration": (["--config", "nowhere.yaml"], "nowhere.yaml"),
    "no such export": (["--export", "coco,voc"], "--export: there is no 'voc'; choose from coco, labelme, geojson"),
    "no such package": (["--pack", "zip"], "there is no 'zip'; choose tar"),
    "no such film": (["--film-out", "gif"], "--film-out gif: choose from mask, overlay, cutout"),
    "parts of films": (
        ["--film-out", "mask", "--shard", "1/2"],
        "--film-out and --shard do not go together; merge the",
    ),
    "pages of parts": (["--report", "--shard", "1/2"], "--report and --shard do not go together; 'ffseg merge DIR"),
    "names without a list": (["-0"], "-0"),
    "chunks of no cluster": (["--chunk", "60"], "--chunk"),
    "another cluster": (["--executor", "inprocess", "--dask", "tcp://a:1"], "--dask is of the executor dask"),
    "the usual chunks of no cluster": (["--chunk", "500", "--executor", "inprocess"], "--chunk"),
    "a map of no camera": (["--map"], "--map needs --camera"),
    "poses of no camera": (["--poses", "poses.csv"], "--camera"),
    "a bag without a topic": (["--bag", "a.bag"], "--bag and --topic go together"),
    "a box without a width": (["--box", "25,35,0,71"], "--box 25,35,0,71: write X,Y,W,H"),
    "two ways to start": (
        ["--at", "133,50", "--starts", "s.csv"],
        "--at starts every image at one place, --starts each",
    ),
    "a start that is none": (["--at", "133"], "--at 133: write X,Y or X,Y,R"),
    "a point that is none": (["--not", "133;50"], "--not 133;50: write X,Y"),
}


@pytest.mark.parametrize(("options", "said"), USAGE.values(), ids=USAGE)
@pytest.mark.parametrize("more", [[], ["--dry-run"]], ids=["run", "dry run"])
def test_refused_early(options: list[str], said: str, more: list[str], tmp_path: Path, ffseg_command: Command) -> None:
    done = ffseg_command("run", SAMPLES, "--out", tmp_path / "out", *options, *more)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert not (tmp_path / "out").exists()


EMPTY = {
    "run --out": (["run", SAMPLES, "--out", ""], "the value of --out is empty"),
    "run --truth=": (["run", SAMPLES, "--out", "out", "--truth="], "the value of --truth is empty"),
    "run INPUT": (["run", "", "--out", "out"], "an argument is empty"),
    "config check": (["config", "check", ""], "an argument is empty"),
    "report": (["report", ""], "an argument is empty"),
}


@pytest.mark.parametrize(("command", "said"), EMPTY.values(), ids=EMPTY)
def test_empty_values_are_refused(command: list[str | Path], said: str, tmp_path: Path, ffseg_command: Command) -> None:
    """As `--truth "$TRUTH"` of an unset variable, which stood for the working directory."""
    done = ffseg_command(*command, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{said}, as of an unset variable; give one" in done.stderr
    assert list(tmp_path.iterdir()) == []


TRUTH = SAMPLES / "truth"
LONG = "n" * 300
RUN, COMPARE, BENCH = ["run", SAMPLES, "--out"], ["compare", SAMPLES, "--out", "out"], ["bench", "--out", "out"]
SCORED = [*COMPARE, "--truth", TRUTH]
LEARN, TUNE = ([command, SAMPLES, "--truth", TRUTH, "--out"] for command in ("learn", "tune"))
WRONG = {
    "a file for a folder": ([*RUN, "file"], "'--out': file is a file; name a folder"),
    "below a file": ([*RUN, "file/out"], "(Not a directory); name another folder"),
    "a file for samples": (["samples", "file"], "file is a file; name a folder"),
    "stdout for a folder": ([*RUN, "-"], "- is no folder; write ./- if it is called so"),
    "address for a folder": ([*RUN, "s3://a/b"], "s3://a/b is an address; outputs go into a folder"),
    "stdin": (["run", "-", "--out", "out"], "write --list - for names and 'ffseg segment - OUT' for an image"),
    "no such image": (["run", "nowhere.png", "--out", "out"], "no file or folder nowhere.png"),
    "no such name": (["run", "*.nothing", "--out", "out"], "matches no file"),
    "nothing": (["run", "--out", "out"], "there is no input"),
    "no number": ([*RUN, "out", "--jobs", "many"], "'many' is not a valid integer"),
    "no number in a gate": ([*BENCH, "--budget", "long"], "'long' is not a valid number"),
    "one number for a place": (["segment", "file", "a.png", "--not", "120"], "--not 120: write X,Y or X,Y,R in pixels"),
    "a class without masks": ([*RUN, "out", "--truth-label", "3"], "add --truth DIR"),
    "no such method": ([*COMPARE, "--methods", "x"], "there is no 'x'"),
    "no such peer's key": ([*COMPARE, "--set", "snake.tensoin=1"], "unknown key"),
    "no truth to compare with": ([*COMPARE, "--truth", "none"], "no folder"),
    "a gate without masks": ([*COMPARE, "--min-iou", "0.9"], "needs truth"),
    "a gate without a number": ([*SCORED, "--min-iou", "freeform=high"], "not a number"),
    "a gate of no method": ([*SCORED, "--min-iou", "cv_edges=0.9"], "not compared"),
    "no such suite": ([*BENCH, "--suite", "pathces"], "there is no suite 'pathces'"),
    "no such baseline": ([*BENCH, "--baseline", "absent.json"], "absent.json cannot be read"),
    "no images": ([*BENCH, "--images", "no", "--suite", "scenes"], "--images: there is no folder no"),
    "a model of another name": ([*LEARN, "a.bin"], ".ffmodel"),
    "a model in no folder": ([*LEARN, "no/m.ffmodel"], "--out: there is no folder no;"),
    "settings in no folder": ([*TUNE, "no/a.yaml"], "--out: there is no folder no;"),
    "a page in no folder": ([*TUNE, "a.yaml", "--page", "no/a.html"], "--page: there is"),
    "a photograph for a page": ([*TUNE, "a.yaml", "--page", "a.png"], "name it .html"),
    "nan seconds to tune": ([*TUNE, "a.yaml", "--budget", "nan"], "nan is not a number"),
    "nan megabytes to embed": (["report", "there", "--embed", "nan"], "nan is not a number"),
    "a class in no mask": ([*TUNE, "a.yaml", "--truth-label", "7"], "no pixel inside, where --truth-label 7 is inside"),
    "no images to show": (["report", "there", "--images", "gone"], "--images: there is no file or folder gone"),
    "a long name for a run": ([*RUN, LONG], "(File name too long); name another folder"),
    "a long name for samples": (["samples", LONG, "--pairs", "0"], "(File name too long); name another folder"),
    "a long name for a report": (["report", LONG], "holds neither timings.csv nor compare.csv"),
    "something else": (["report", "."], "holds neither timings.csv nor compare.csv; give the --out folder"),
    "a long name for a baseline": ([*BENCH, "--baseline", LONG], "cannot be read (File name too long)"),
    "a folder for a baseline": ([*BENCH, "--baseline", "there"], "there is not a regular file"),
    "settings of one's own": ([*TUNE, "my.yaml"], "my.yaml is there already and not known as a file of ffseg; choose"),
    "a page of one's own": (
        [*TUNE, "a.yaml", "--page", "my.html"],
        "not known as a file of ffseg; choose another name for --page",
    ),
    "a model of others": ([*LEARN, "my.ffmodel"], "not known as a file of ffseg; choose another name for --out"),
    "a report of one's own": (
        ["report", "there"],
        "there/report.html is there already and not known as a file of ffseg; move",
    ),
    "a long name for settings": ([*TUNE, f"{LONG}.yaml"], ".yaml cannot be written; choose another name"),
}


@pytest.mark.parametrize(("command", "said"), WRONG.values(), ids=WRONG)
def test_errors_name_the_remedy(command: list[str | Path], said: str, tmp_path: Path, ffseg_command: Command) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "timings.csv").write_text("image,status\n")
    for name in (mine := ("file", "my.ffmodel", "my.html", "my.yaml", "there/report.html")):
        (tmp_path / name).write_text("mine")
    done = ffseg_command(*command, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in " ".join(done.stderr.split())
    assert {path.name for path in tmp_path.iterdir()} == {*mine[:-1], "there"}
    assert {(tmp_path / name).read_text() for name in mine} == {"mine"}


def test_a_tilde_is_the_home_folder(tmp_path: Path, ffseg_command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--out=~/out`, whose tilde no shell replaces, made a folder `~` to be removed with care."""
    monkeypatch.setenv("HOME", str(tmp_path))
    ffseg_command("run", SAMPLES / "toy.png", "--out=~/out", cwd=SAMPLES, code=0)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_quiet_commands_tell_failures_only(tmp_path: Path, ffseg_command: Command) -> None:
    (tmp_path / "in").mkdir()
    shutil.copy(SAMPLES / "toy.png", tmp_path / "in" / "good.png")
    (tmp_path / "in" / "text.png").write_text("no image")
    moved = ["--set", "init.radius=160"]  # across an edge: a note, not a failure
    assert "good.png: the start at" in ffseg_command("run", "in", "--out", "loud", *moved, cwd=tmp_path).stderr
    for command in (["run", "in", "--out", "q", *moved], ["compare", "in", "--out", "c", "--methods", "freeform"]):
        done = ffseg_command(*command, "-q", cwd=tmp_path)
        assert (done.returncode, done.stdout) == (3, "")
        assert "text.png" in done.stderr
        assert "good.png" not in done.stderr


def test_config_check_names_a_method_and_a_mask_that_are_not_there(tmp_path: Path, ffseg_command: Command) -> None:
    (tmp_path / "method.yaml").write_text("method: freefrm\n")
    (tmp_path / "mask.yaml").write_text("domain:\n  mask: nofile.png\n")
    done = ffseg_command("config", "check", "method.yaml", "mask.yaml", cwd=tmp_path, code=2)
    assert "method.yaml:1: method: 'freefrm' is not one of" in done.stderr
    assert "mask.yaml: domain.mask: there is no file nofile.png" in done.stderr


@pytest.mark.parametrize(
    "option", ["--starts", "--camera", "--poses", "--pairs", "--config", "--set=domain.mask", "--set=init.mask"]
)
def test_pipes_that_options_name_are_not_waited_for(option: str, tmp_path: Path, ffseg_command: Command) -> None:
    os.mkfifo(tmp_path / "pipe")
    given = [f"{option}=pipe"] if "=" in option else [option, "pipe"]
    if option in ("--poses", "--pairs"):
        (tmp_path / "camera.yaml").write_text("model: unified\n")
        given += ["--camera", "camera.yaml"]
    done = ffseg_command("run", SAMPLES, "--out", "out", *given, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_mask_larger_than_any_image_is_refused_unread(tmp_path: Path, ffseg_command: Command) -> None:
    with (tmp_path / "large.png").open("wb") as file:
        file.truncate(1 << 40)
    done = ffseg_command(
        "run", SAMPLES, "--out", tmp_path / "out", "--set", f"domain.mask={tmp_path / 'large.png'}", code=2
    )
    assert "large.png cannot be used: the file has 1099511627776 bytes, the limit is" in done.stderr


def test_a_pipe_for_a_truth_is_not_waited_for(tmp_path: Path, ffseg_command: Command) -> None:
    shutil.copy(SAMPLES / "toy.png", tmp_path / "toy.png")
    (tmp_path / "truth").mkdir()
    os.mkfifo(tmp_path / "truth" / "toy.png")
    done = ffseg_command("run", "toy.png", "--out", "out", "--truth", "truth", cwd=tmp_path, code=3)
    assert "a named pipe" in done.stderr


def test_masks_that_agree_nowhere_are_said(tmp_path: Path, ffseg_command: Command) -> None:
    """A class number that is in no mask scored 0 for every image without a word."""
    for command in (["run"], ["compare", "--methods", "freeform"]):
        scored = [*command, SAMPLES / "toy.png", "--out", tmp_path / command[0], "--truth", TRUTH]
        assert "every IoU is 0" not in ffseg_command(*scored).stderr
        done = ffseg_command(*scored, "--truth-label", "7", *(["--overwrite"] if command == ["run"] else []), code=0)
        assert "every IoU is 0: the true masks hold nothing of what was found; look at --truth" in done.stderr
