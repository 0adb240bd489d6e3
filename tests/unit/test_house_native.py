"""The house rules of the C++ core: sizes of files, functions, classes and folders, and one definition of each name."""

from __future__ import annotations

from collections import Counter, defaultdict
from pathlib import Path

import pytest
from cpp_sources import blocks

CORE = Path(__file__).resolve().parents[2] / "ffseg" / "native"
SOURCES = sorted(path for path in CORE.rglob("*") if path.suffix in {".cpp", ".hpp"})
NAMES = [str(path.relative_to(CORE)) for path in SOURCES]
FILE_LINES = 300
FUNCTION_LINES = 60
CLASS_MEMBERS = 25
FOLDER_PARTS = 9


def room_of(path: Path) -> str:
    """Namespace that the files of a folder open."""
    folder = path.parent.relative_to(CORE)
    return "ffseg" if folder.name == "common" else f"ffseg::{folder.name}"


def test_there_are_sources() -> None:
    assert len(SOURCES) > 40


def test_no_file_is_too_long() -> None:
    lengths = {str(path.relative_to(CORE)): len(path.read_text("utf-8").splitlines()) for path in SOURCES}
    assert {name: length for name, length in lengths.items() if length > FILE_LINES} == {}


@pytest.mark.parametrize("path", SOURCES, ids=NAMES)
def test_no_function_is_too_long(path: Path) -> None:
    long = {item.name: item.lines for item in blocks(path) if item.kind == "function" and item.lines > FUNCTION_LINES}
    assert long == {}


@pytest.mark.parametrize("path", SOURCES, ids=NAMES)
def test_no_class_has_too_many_members(path: Path) -> None:
    large = {item.name: item.members for item in blocks(path) if item.kind == "class" and item.members > CLASS_MEMBERS}
    assert large == {}


def test_no_folder_holds_too_many_parts() -> None:
    parts = {path.with_suffix("") for path in SOURCES}  # a header and its source are one
    counts = Counter(part.parent.relative_to(CORE) for part in parts)
    assert {str(folder): count for folder, count in counts.items() if count > FOLDER_PARTS} == {}


@pytest.mark.parametrize("path", SOURCES, ids=NAMES)
def test_each_room_has_its_namespace(path: Path) -> None:
    opened = {item.name for item in blocks(path) if item.kind == "namespace" and not item.parents} - {"(anonymous)"}
    assert opened <= {room_of(path)}


def test_no_class_is_defined_twice() -> None:
    """Two definitions of one name in one namespace are one to the linker, which keeps either."""
    places = defaultdict(set)
    for path in SOURCES:
        for item in blocks(path):
            outermost = all(parent.kind == "namespace" for parent in item.parents)
            if item.kind in ("class", "enum") and outermost and "(anonymous)" not in item.namespace:
                places[f"{item.namespace}::{item.name}"].add(str(path.relative_to(CORE)))
    assert {name: sorted(found) for name, found in places.items() if len(found) > 1} == {}


def test_braces_are_matched(tmp_path: Path) -> None:
    """The counting itself: heads that span lines, initialiser lists, lambdas and texts with braces."""
    source = tmp_path / "a.hpp"
    source.write_text(
        "namespace a::b {\nstruct P : Q {\n    int x = 0, y{1};\n    std::array<int, 3> z;\n    P(int n)\n        : x(n) {\n"
        '        call([](int) { return "}"; });\n    }\n    void f() const;\n    static constexpr int kOne = 1;\n};\n}\n'
    )
    found = {item.name: item for item in blocks(source)}
    assert found["P"].kind == "class"
    assert found["P"].members == 5  # x, y, z, the constructor and f
    assert found["P"].namespace == "a::b"
    assert max(item.lines for item in blocks(source) if item.kind == "function") == 3
