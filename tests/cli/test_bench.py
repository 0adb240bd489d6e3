"""``ffseg bench`` as a command: reports, the gate and its exit codes."""

import json
from pathlib import Path
from subprocess import CompletedProcess

import pytest
from batches import table
from commands import Command

QUICK = ("bench", "--quick", "--suite", "patches", "--out")

Report = tuple[Path, CompletedProcess[str]]


@pytest.fixture(scope="module")
def report(ffseg_command: Command, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, CompletedProcess[str]]:
    folder = tmp_path_factory.mktemp("bench") / "report"
    return folder, ffseg_command(*QUICK, folder)


def test_report_is_written_and_shown(report: Report) -> None:
    folder, done = report
    assert done.returncode == 0, done.stderr
    assert done.stdout == (folder / "bench.md").read_text("utf-8").rstrip("\n") + "\n"
    document = json.loads((folder / "bench.json").read_text("utf-8"))
    assert [row["case"] for row in table(folder / "bench.csv")] == [figure["case"] for figure in document["figures"]]
    series = {"still iteration", "filtered iteration", "merging iteration"}
    assert {growth["series"] for growth in document["growth"]} == series
    assert document["versions"]["ffseg"]
    assert document["machine"]["cores"] >= 1
    assert all(len(figure["values"]) == len(figure["kernel_values"]) for figure in document["figures"])
    assert "patches: N = 100" in done.stderr


def with_steady(path: Path, factor: float, target: Path) -> Path:
    """A baseline whose figures are so many times those of a report."""
    document = json.loads((path / "bench.json").read_text("utf-8"))
    for figure in document["figures"]:
        figure["steady"] *= factor
    target.write_text(json.dumps(document), "utf-8")
    return target


def test_gate_missed_exits_4_and_names_what_got_slower(report: Report, ffseg_command: Command, tmp_path: Path) -> None:
    baseline = with_steady(report[0], 0.01, tmp_path / "fast.json")
    done = ffseg_command(*QUICK, tmp_path / "out", "--baseline", baseline, "--max-ratio", "2", "--json", code=4)
    document = json.loads(done.stdout)
    assert {item["key"] for item in document["slower"]} == {figure["key"] for figure in document["figures"]}
    assert "ffseg: error: patches/still, 100/iteration: " in done.stderr
    assert "times the baseline" in done.stderr
    assert "## Slower than the baseline" in (tmp_path / "out" / "bench.md").read_text("utf-8")


def test_gate_held_exits_with_0(report: Report, ffseg_command: Command, tmp_path: Path) -> None:
    ffseg_command(*QUICK, tmp_path / "out", "--baseline", with_steady(report[0], 100, tmp_path / "slow.json"), code=0)


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"format": 1, "quick": true, "figures": [{"key": "a", "steady": 1' + "0" * 400 + "}]}"]
)
def test_a_baseline_that_no_parser_takes_is_refused(text: str, ffseg_command: Command, tmp_path: Path) -> None:
    (tmp_path / "odd.json").write_text(text)
    done = ffseg_command("bench", "--quick", "--out", "out", "--baseline", "odd.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "odd.json is no bench.json; give that of an earlier run" in done.stderr


def test_a_baseline_without_a_common_figure_cannot_pass(report: Report, ffseg_command: Command, tmp_path: Path) -> None:
    baseline = report[0] / "bench.json"
    done = ffseg_command("bench", "--quick", "--suite", "size", "--out", tmp_path, "--baseline", baseline, code=2)
    assert "no figure of this run" in done.stderr


def test_a_suite_that_fails_leaves_what_was_measured_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from ffseg.bench import session
    from ffseg.cli.commands.bench import bench
    from ffseg.errors import FfsegError

    def broken(*_: object) -> None:
        raise FfsegError("no such luck")

    monkeypatch.setitem(session.SUITES, "startup", broken)
    with pytest.raises(FfsegError, match="luck") as failed:
        bench(tmp_path / "out", ["patches", "startup"], quick=True)
    assert failed.value.exit_code == 3  # not 2: something was measured
    document = json.loads((tmp_path / "out" / "bench.json").read_text("utf-8"))
    assert {figure["suite"] for figure in document["figures"]} == {"patches"}
    assert (tmp_path / "out" / "bench.md").read_text("utf-8").count("iteration") > 0
