"""The house rules that no linter checks: sizes of files and functions, and a namespace of its own for each room of the core.

Two definitions of one name in the core are found by the build of all sources as one (``tests/campaigns/builds.py --only lto``).
"""

import ast
import re
import tomllib
from collections import Counter
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from check import oldest

PACKAGE = Path(__file__).resolve().parents[2] / "ffseg"
CORE = PACKAGE / "native"
MODULES = sorted(PACKAGE.rglob("*.py"))
SOURCES = sorted(path for path in CORE.rglob("*") if path.suffix in {".cpp", ".hpp"})
FUNCTION_LINES, NATIVE_FUNCTION_LINES = 40, 60
SHARED = {"Box", "Doubt", "Journal", "Node", "Region", "Row", "Samples", "Task", "World"}
"""Names of two classes: the same thing drawn by two renderers or kept by several commands, words of apart rooms, public names."""
NO_FUNCTION = re.compile(r"(public|private|protected):|(namespace|class|struct|union|enum)\b")


def name(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


@pytest.mark.parametrize(("paths", "least", "most"), [(MODULES, 20, 500), (SOURCES, 40, 300)], ids=["Python", "C++"])
def test_no_file_is_too_long(paths: list[Path], least: int, most: int) -> None:
    lengths = {name(path): len(path.read_text("utf-8").splitlines()) for path in paths}
    assert len(lengths) > least
    assert {name: length for name, length in lengths.items() if length > most} == {}


def lines_of(function: ast.FunctionDef) -> int:
    """Lines from the def to the end, without the docstring and the signature."""
    body = function.body
    if isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant) and len(body) > 1:
        body = body[1:]
    return (body[-1].end_lineno or 0) - body[0].lineno + 2


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_no_function_is_too_long(path: Path) -> None:
    functions = [node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.FunctionDef)]
    assert {item.name: lines_of(item) for item in functions if lines_of(item) > FUNCTION_LINES} == {}


def test_a_class_name_means_one_thing() -> None:
    trees = [ast.parse(path.read_text("utf-8")) for path in MODULES]
    names = (node.name for node in chain.from_iterable(tree.body for tree in trees) if isinstance(node, ast.ClassDef))
    assert {name for name, count in Counter(names).items() if count > 1 and name[0] != "_"} == SHARED


def test_types_of_arrays_are_named_once() -> None:
    texts = (path.read_text("utf-8") for path in MODULES)
    names = [name for text in texts for name in re.findall(r"^(\w+) = NDArray\[", text, re.MULTILINE)]
    assert {name for name, count in Counter(names).items() if count > 1} == set()


def long_functions(text: str) -> list[str]:
    """First lines of what is too long: from a line to the next of its indent, which clang-format makes a closing brace."""
    found, last = [], dict[int, tuple[int, str]]()
    for number, line in enumerate(text.splitlines()):
        indent = len(line) - len(line.lstrip())
        begin, head = last.get(indent, (number, ""))
        if line.lstrip().startswith("}") and number - begin >= NATIVE_FUNCTION_LINES and not NO_FUNCTION.match(head):
            found.append(head)
        if line.strip():
            last[indent] = (number, line)
    return found


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_no_native_function_is_too_long(path: Path) -> None:
    assert long_functions(path.read_text("utf-8")) == []


@pytest.mark.parametrize("head", ["int f() {", "    void g(int a,\n           int b) const {"])
def test_a_long_native_function_is_noticed(head: str) -> None:
    indent = " " * (len(head) - len(head.lstrip()))
    body = f"{indent}    if (a) {{\n{indent}        b();\n{indent}    }}\n"
    long, short = (f"struct S {{\n{head}\n{body * count}{indent}}}\n}};\n" for count in (20, 10))
    assert (long_functions(long), long_functions(short)) == ([head.split("\n", maxsplit=1)[0]], [])


@pytest.mark.parametrize("path", SOURCES, ids=name)
def test_each_room_has_its_namespace(path: Path) -> None:
    folder = path.parent.relative_to(CORE)
    room = "ffseg" if folder.name == "common" else f"ffseg::{folder.name}"
    assert set(re.findall(r"^namespace ([\w:]+) \{", path.read_text("utf-8"), re.M)) <= {room}


def test_what_the_tests_need_goes_with_the_oldest_dependencies() -> None:
    """Else `check.py --oldest` finds nothing to install: they once asked for a newer PyAV than films do."""
    project = tomllib.loads((PACKAGE.parent / "pyproject.toml").read_text("utf-8"))["project"]
    needed = {one.name: one.specifier for one in map(Requirement, project["optional-dependencies"]["test"])}
    pinned = {name: f"{least}.999" for name, least in (line.removesuffix(".*").split("==") for line in oldest())}
    assert len(pinned.keys() & needed.keys()) > 5
    assert [name for name in pinned.keys() & needed.keys() if pinned[name] not in needed[name]] == []
