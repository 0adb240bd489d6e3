"""Plug-ins from a folder outside the clone, as docs/extending.md shows them."""

import json
import re
import subprocess
import sys
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from batches import table
from commands import Command

from ffseg.errors import ParameterError
from ffseg.parameter_files import load_params
from ffseg.plugins import find

ROOT = Path(__file__).resolve().parents[2]
ODD = """\
def up(result, context): return b''
up.folder = '../up'
def mask(result, context): ...
mask.folder = 'masks'
def none(do, tasks): return []
def text(result, context): return 'text'
def silent(do, tasks): list(tasks)
def number(result, context): ...
number.suffix = 3
def over(contents, label): raise ValueError('no more')
def leaves(scene): raise SystemExit
def breaks(scene): return [][scene.factor]
from ffseg.batch.outputs.table import Output
away, table, gone, bad = (
    Output('odd', 'odd', '.json', 'areas:encode', 'odd:' + merge, name)
    for merge, name in (('over', '../odd.txt'), ('over', 'timings.csv'), ('nothing', 'odd.txt'), ('over', 'odd.txt'))
)
"""
OWN = ("--set", "method=bright:run", "--set", "edges.source=red:edges", "--export", "areas:encode")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the four files of the page, and two images."""
    text = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n# (\w+\.py)\n(.*?)```", text, re.DOTALL)
    assert [name for name, _ in blocks] == ["bright.py", "red.py", "areas.py", "threads.py"]
    for name, code in blocks:
        assert len(code.splitlines()) <= 20, "a plug-in fits a small file"
        (tmp_path / name).write_text(code, encoding="utf-8")
    (tmp_path / "odd.py").write_text(ODD)
    (tmp_path / "photos").mkdir()
    for name in ("a.png", "b.png"):
        (tmp_path / "photos" / name).write_bytes((ROOT / "samples" / "toy.png").read_bytes())
    return tmp_path


def statuses(out: Path) -> list[str]:
    return [f"{row['image']} {row['status']} {row['method']}" for row in table(out / "timings.csv")]


def script(*arguments: str, folder: Path) -> CompletedProcess[str]:
    """The installed command, which unlike ``python -m`` does not have the working directory in its path."""
    command = [Path(sys.executable).with_name("ffseg"), *arguments]
    return subprocess.run(command, check=False, capture_output=True, text=True, cwd=folder)


def test_four_plug_ins_at_once(folder: Path) -> None:
    for word, how in (("done", ("--executor", "threads:threads")), ("unchanged", ("--jobs", "2"))):
        done = script("run", "photos", "--out", "out", *OWN, *how, "--json", folder=folder)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["counts"][word] == 2
    assert statuses(folder / "out") == ["a.png ok bright:run", "b.png ok bright:run"]
    assert sum(json.loads((folder / "out" / "areas" / "a.json").read_text())) > 1000
    (folder / "bright.py").write_text((folder / "bright.py").read_text().replace("< 40", "< 30"))
    stale = script("run", "photos", "--out", "out", *OWN, folder=folder)
    assert (stale.returncode, "methods bright:run has changed" in " ".join(stale.stderr.split())) == (2, True)


def test_workers_find_plug_ins_and_pictures_of_theirs_are_no_inputs(folder: Path) -> None:
    (folder / "areas.py").write_text((folder / "areas.py").read_text().replace('".json"', '".png"'))
    done = script("run", "photos", "--out", "photos", *OWN, "--jobs", "2", folder=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "photos" / "areas" / "b.png").is_file()
    again = script("run", "photos", "--out", "photos", *OWN, "--jobs", "2", "--json", folder=folder)
    assert json.loads(again.stdout)["counts"] == {"total": 2, "done": 0, "unchanged": 2, "failed": 0, "stale": 0}


def test_a_method_of_ones_own_is_compared(folder: Path, ffseg_process: Command) -> None:
    done = ffseg_process("compare", "photos/a.png", "--out", "out", "--methods", "freeform,bright:run", cwd=folder)
    assert done.returncode == 0, done.stderr
    rows = table(folder / "out" / "compare.csv")
    assert [(row["method"], row["status"]) for row in rows] == [("freeform", "ok"), ("bright:run", "ok")]


def test_a_method_of_ones_own_is_measured(folder: Path) -> None:
    options = ("--suite", "method", "--methods", "bright:run", "--quick", "--out", "out")
    done = script("bench", *options, folder=folder)
    assert done.returncode == 0, done.stderr
    assert "small by bright:run" in (folder / "out" / "bench.md").read_text()


@pytest.mark.parametrize(
    ("command", "options", "sentence"),
    [
        ("run", "--set method=nope:otsu", "method: 'nope:otsu' cannot be loaded: No module named 'nope'"),
        ("run --dry-run", "--set method=bright:rum", "module 'bright' has no attribute 'rum'"),
        ("compare", "--methods bright:np", "method: bright:np is no function"),
        ("run", "--set edges.source=wrong:edges", "edges.source: 'wrong:edges' cannot be loaded: NameError: "),
        ("compare", "--methods freefrm", "did you mean 'freeform'?"),
        ("compare", "--config theirs.yaml", "theirs.yaml: method: bright:run imports code that the file names"),
        ("run", "--export odd:up", "odd:up has folder '../up'"),
        ("run", "--export odd:mask", "which is ffseg's own"),
        ("run", "--export odd:number", "suffix 3; give one plain name, and one that begins with a dot"),
        ("run", "--export odd:away", "odd:away puts all images into '../odd.txt'; give a plain name"),
        ("run", "--export odd:table", "'timings.csv'; give a plain name of a file that is not ffseg's own"),
        ("run", "--export odd:gone", "--export: odd:gone: 'odd:nothing' cannot be loaded: "),
        ("run", "--set method=ends:run", "method: 'ends:run' cannot be loaded: SystemExit: 0"),
        ("run", "--export cooc", "--export: there is no 'cooc'; did you mean 'coco'?"),
        ("run", "--executor os:system", "--executor: os:system cannot be called as system(do, tasks): "),
        ("run --dry-run", "--set method=os:getpid", "method: os:getpid cannot be called as getpid(scene): "),
        ("compare", "--methods areas:encode", "method: areas:encode cannot be called as encode(scene): "),
        ("segment", "--set edges.source=threads:threads", "threads:threads cannot be called as threads(scene): "),
        ("run", "--export bright:run", "--export: bright:run cannot be called as run(result, context): "),
        ("run", "--executor dusk", "--executor: there is no 'dusk'; did you mean 'dask'?"),
    ],
)
def test_a_wrong_name_is_told(command: str, options: str, sentence: str, folder: Path, ffseg_process: Command) -> None:
    (folder / "wrong.py").write_text("edges = undefined\n")
    (folder / "theirs.yaml").write_text("method: bright:run\n")
    (folder / "ends.py").write_text("raise SystemExit(0)\n")
    where = ("photos/a.png", "out.png") if command == "segment" else ("photos", "--out", "out")
    done = ffseg_process(*command.split(), *where, *options.split(), cwd=folder)
    assert (done.returncode, sentence in " ".join(done.stderr.split())) == (2, True), done.stderr
    assert not (folder / "out").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--executor odd:none", "crash: the executor odd:none gave no reply for it"),
        ("--export odd:text", "segmentation: the output odd:text gave str, not bytes"),
        ("--set method=odd:breaks", "internal: IndexError in odd.py, line 12: list index out of range"),
        ("--set edges.source=odd:breaks", "internal: IndexError in odd.py, line 12: list index out of range"),
    ],
)
def test_a_wrong_plug_in_costs_the_images(options: str, sentence: str, folder: Path, ffseg_process: Command) -> None:
    done = ffseg_process("run", "photos", "--out", "out", *options.split(), cwd=folder)
    assert done.returncode == 3
    assert sentence in (folder / "out" / "timings.csv").read_text()


def test_a_merge_that_fails_costs_its_file_alone(folder: Path, ffseg_process: Command) -> None:
    done = ffseg_process("run", "photos", "--out", "out", "--export", "odd:bad", cwd=folder)
    assert done.returncode == 3
    assert "odd.txt cannot be written: odd:over of --export odd failed (ValueError: no more)" in done.stderr
    assert statuses(folder / "out") == ["a.png ok freeform", "b.png ok freeform"]
    assert not (folder / "out" / "odd.txt").exists()


@pytest.mark.parametrize("command", ["segment photos/a.png a.png", "run photos --out out --executor inprocess"])
def test_a_method_that_ends_the_program_is_told(command: str, folder: Path, ffseg_process: Command) -> None:
    done = ffseg_process(*command.split(), "--set", "method=odd:leaves", cwd=folder)
    assert done.returncode == 1
    assert "unexpected SystemExit" in done.stderr


def test_an_executor_that_gives_nothing_is_told(folder: Path, ffseg_process: Command) -> None:
    done = ffseg_process("run", "photos", "--out", "out", "--executor", "odd:silent", cwd=folder)
    assert done.returncode == 2
    assert "--executor: odd:silent gave NoneType, not what do(task) returned for each task" in done.stderr


def test_code_that_a_file_names_is_imported_when_it_may_be(folder: Path, ffseg_process: Command) -> None:
    (folder / "mine.yaml").write_text("method: bright:run\n")
    done = ffseg_process("run", "photos", "--out", "out", "--config", "mine.yaml", "--allow-code", cwd=folder)
    assert done.returncode == 0, done.stderr
    with pytest.raises(ParameterError, match="allow_code=True"):
        load_params(folder / "mine.yaml")
    assert load_params(folder / "mine.yaml", allow_code=True).method == "bright:run"
    assert load_params(folder / "mine.yaml", {"method": "snake"}).method == "snake"  # what is not used imports nothing


def test_installed_plug_ins_are_known_by_name(folder: Path, ffseg_process: Command, tmp_path: Path) -> None:
    about = folder / "bright-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: bright\nVersion: 1.0\n")
    points = {
        "methods": "bright = bright:run",
        "outputs": "areas = areas:encode",
        "executors": "four = threads:threads",
    }
    (about / "entry_points.txt").write_text("".join(f"[ffseg.{kind}]\n{text}\n" for kind, text in points.items()))
    (folder / "mine.yaml").write_text("method: bright\n")
    options = ("--config", "mine.yaml", "--export", "areas", "--executor", "four")
    done = ffseg_process("run", "photos", "--out", "out", *options, cwd=folder, env={"PYTHONPATH": str(folder)})
    assert done.returncode == 0, done.stderr
    assert statuses(folder / "out") == ["a.png ok bright", "b.png ok bright"]
    assert (folder / "out" / "areas" / "b.json").is_file()
    wrong = ("run", "photos", "--out", "no", "--set", "method=brigth")
    done = ffseg_process(*wrong, cwd=folder, env={"PYTHONPATH": str(folder)})
    assert done.stderr.rstrip().endswith("did you mean 'bright'?")


def test_a_built_in_is_found_without_looking_further() -> None:
    assert find("executors", "inprocess") is map
