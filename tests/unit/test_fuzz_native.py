"""R13 in short form: the native core under sanitizers, its bindings as they are installed, and what is said of findings."""

import subprocess
import sys
from pathlib import Path

import pytest

from ffseg.native import _core
from tests.campaigns import compiling, fuzz_native, sanitized

CASES = 400
"""Four rounds of all targets; a tenth of them reach a map of one pixel or a strip."""

STUB = """\
#!{python}
import sys
given = dict(zip(sys.argv[1::2], sys.argv[2::2]))
first, cases = int(given["--first"]), int(given["--cases"])
if first <= 3 < first + cases:
    open(given["--mark"], "w").write("3")
    sys.exit("file.cpp:7: runtime error: index 9 out of bounds")
print("evolve", cases, 0.5, 0.25, first)
"""


def test_native_cases_under_sanitizers_are_clean(pytestconfig: pytest.Config) -> None:
    try:
        sanitized.BUILD.check()
    except compiling.NoCompilerError as error:
        pytest.skip(str(error))
    work = pytestconfig.cache.mkdir("sanitized")  # compiled objects are kept for as long as their sources are the same
    figures = fuzz_native.campaign(work, CASES, build=sanitized.FOR_FEW)
    assert (figures.findings, figures.cases) == ([], CASES)
    assert {"evolve", "rasterize", "edges", "march", "level_set", "snake", "scores"} <= set(figures.targets)
    assert all(count.cases > 0 for count in figures.targets.values())


def test_bindings_survive_what_does_not_fit(tmp_path: Path) -> None:
    command = fuzz_native.border_command(tmp_path, _core.__file__, "--cases", 700)
    done = subprocess.run(command, cwd=compiling.ROOT, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, (tmp_path / "border-case").read_text() + done.stderr[-500:]
    assert done.stdout.splitlines()[-1] == "700 cases"
    for name in ("evolve", "rasterize", "edge_maps", "level_sets", "snakes", "pairs", "lists"):
        for end in ("passed", "refused"):
            assert f"{name} {end}" in done.stdout


def test_a_finding_is_named_and_the_next_case_follows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stub = tmp_path / "stub"
    stub.write_text(STUB.format(python=sys.executable))
    stub.chmod(0o755)
    monkeypatch.setattr(sanitized, "build_driver", lambda *_: stub)
    figures = fuzz_native.campaign(tmp_path, 10)
    assert figures.findings == ["case 3: file.cpp:7: runtime error: index 9 out of bounds"]
    assert "runtime error" in (tmp_path / "finding-3.txt").read_text()
    assert figures.targets["evolve"] == fuzz_native.Count(6, 0.5, 0.25, 4)


def test_a_compiler_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    sentence = "there is no C\\+\\+ compiler no-such-compiler; name one in CXX"
    with pytest.raises(compiling.NoCompilerError, match=sentence):
        compiling.compiler()
