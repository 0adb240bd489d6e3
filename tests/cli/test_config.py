"""``ffseg config`` and ``ffseg samples``: exit code, sentence, effect."""

import json
from pathlib import Path

from commands import Command

from ffseg import __version__, parameter_changes
from ffseg.parameter_changes import since_0_1
from ffseg.parameter_files import load_params, presets, written
from ffseg.schema.nodes import Problems
from ffseg.schema.sections import flat

ROOT = Path(__file__).resolve().parents[2]


def test_list_names_every_preset_with_purpose_and_file(ffseg_command: Command) -> None:
    done = ffseg_command("config", "list", code=0)
    lines = done.stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(presets())
    assert all(str(path) in line for line, path in zip(lines, presets().values(), strict=True))
    assert "$schema" not in done.stdout


def test_show_can_be_read_back(ffseg_command: Command, tmp_path: Path) -> None:
    changed = ("--set", "contour.degree=2", "--set", "init.mask='a: b.png'")
    done = ffseg_command("config", "show", "toy-full", *changed, code=0)
    file = tmp_path / "shown.yaml"
    file.write_text(done.stdout.replace("a: b.png", str(tmp_path / "a: b.png")), encoding="utf-8")
    expected = load_params("toy-full", {"contour.degree": 2, "init.mask": str(tmp_path / "a: b.png")})
    assert load_params(file) == expected


def test_check_names_good_files_and_every_problem_of_bad_ones(ffseg_command: Command, tmp_path: Path) -> None:
    good, bad, worse = tmp_path / "good.yaml", tmp_path / "bad.yaml", tmp_path / "worse.yaml"
    good.write_text("region.largest: 2\n")
    bad.write_text("contour.degree: 8\ncontuor: {}\n")
    worse.write_text("[")
    done = ffseg_command("config", "check", bad, good, worse, code=2)
    assert done.stdout == f"{good}: ok\n"
    lines = done.stderr.splitlines()
    assert lines[0] == f"ffseg: error: {bad}:1: contour.degree: 8 is not an integer from 1 to 6"
    assert lines[1] == f"{bad}:2: contuor: unknown key; did you mean 'contour'?"
    assert lines[2].startswith(f"{worse}:1: not valid YAML")
    assert len(lines) == 3


def test_schema_is_json_and_the_one_beside_the_presets(ffseg_command: Command) -> None:
    done = ffseg_command("config", "schema")
    assert json.loads(done.stdout) == json.loads((ROOT / "configs/schema.json").read_text("utf-8"))


def test_every_preset_points_its_editor_to_the_schema() -> None:
    for path in presets().values():
        assert path.read_text("utf-8").startswith("# yaml-language-server: $schema=schema.json\n")


def test_samples_writes_the_committed_bytes(ffseg_command: Command, tmp_path: Path) -> None:
    done = ffseg_command("samples", tmp_path / "new" / "folder", code=0)
    written, committed = (
        {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (tmp_path / "new" / "folder", ROOT / "samples")
    )
    assert (written, len(done.stdout.splitlines())) == (committed, len(written))


THEN_FILE = ROOT / "tests/golden/parameters-0.1.yaml"


def test_the_table_of_0_1_is_its_default_file_and_each_key_is_still_read() -> None:
    problems = Problems()
    assert written(THEN_FILE, problems) == parameter_changes.OLD_DEFAULTS
    assert not problems.lines
    lines = since_0_1(parameter_changes.OLD_DEFAULTS)
    assert [line.partition(":")[0] for line in lines[:-1]] == list(parameter_changes.ADDED_KEYS)
    assert lines[-1].startswith("# init.boxes means now: the objects inside them")
    assert lines[0] == "edges.source: gradient  # auto now"


def test_check_says_what_to_add_to_a_file_of_0_1_for_its_results(ffseg_command: Command, tmp_path: Path) -> None:
    file = tmp_path / "old.yaml"
    file.write_text("contour:\n  clearance: 8\n  balloon: 4\ninit:\n  radius: 80\n")
    done = ffseg_command("config", "check", "old.yaml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "old.yaml: ok\n")
    first, *lines = done.stderr.splitlines()
    assert first.startswith("old.yaml: of defaults that it leaves out some have changed")
    changed = {"contour.split_threshold", "contour.max_iterations", "edges.source", "domain.disc", "input.range"}
    assert {line.partition(":")[0] for line in lines} == changed
    file.write_text(file.read_text() + "\n".join(lines) + "\n")
    kept = flat(load_params(file))
    then = (
        parameter_changes.OLD_DEFAULTS | parameter_changes.ADDED_KEYS | {"contour.clearance": 8.0, "init.radius": 80.0}
    )
    assert {key: kept[key] for key in then} == then
    assert not ffseg_command("config", "check", "old.yaml", cwd=tmp_path).stderr
    image = ROOT / "samples/toy.png"
    ffseg_command("run", image, "--out", "out", "--config", "old.yaml", cwd=tmp_path, code=0)
    file.write_text(f"# ffseg tune {__version__}\ncontour:\n  clearance: 8\n")
    said = ffseg_command("config", "check", "old.yaml", cwd=tmp_path).stderr
    assert not said, "a file of now leaves out what it likes"


def test_check_says_nothing_of_0_1_for_presets_and_newer_keys(ffseg_command: Command, tmp_path: Path) -> None:
    (tmp_path / "new.yaml").write_text("edges: {levels: root}\n")
    done = ffseg_command("config", "check", "toy-full", "new.yaml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
