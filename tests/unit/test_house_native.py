"""The house rules of the C++ core: sizes of files and functions, and a namespace of its own for each room.

Two definitions of one name are found by the build of all sources as one (``tests/campaigns/builds.py --only lto``).
"""

import re
from pathlib import Path

import pytest

CORE = Path(__file__).resolve().parents[2] / "ffseg" / "native"
SOURCES = sorted(path for path in CORE.rglob("*") if path.suffix in {".cpp", ".hpp"})
NAMES = [str(path.relative_to(CORE)) for path in SOURCES]
FILE_LINES = 300
FUNCTION_LINES = 60
NO_FUNCTION = re.compile(r"(public|private|protected):|(namespace|class|struct|union|enum)\b")


def test_no_file_is_too_long() -> None:
    lengths = {name: len(path.read_text("utf-8").splitlines()) for name, path in zip(NAMES, SOURCES, strict=True)}
    assert len(lengths) > 40
    assert {name: length for name, length in lengths.items() if length > FILE_LINES} == {}


def long_functions(text: str) -> list[str]:
    """First lines of what is too long: from a line to the next of its indent, which clang-format makes a closing brace."""
    found, last = [], dict[int, tuple[int, str]]()
    for number, line in enumerate(text.splitlines()):
        indent = len(line) - len(line.lstrip())
        begin, head = last.get(indent, (number, ""))
        if line.lstrip().startswith("}") and number - begin >= FUNCTION_LINES and not NO_FUNCTION.match(head):
            found.append(head)
        if line.strip():
            last[indent] = (number, line)
    return found


@pytest.mark.parametrize("path", SOURCES, ids=NAMES)
def test_no_function_is_too_long(path: Path) -> None:
    assert long_functions(path.read_text("utf-8")) == []


@pytest.mark.parametrize("head", ["int f() {", "    void g(int a,\n           int b) const {"])
def test_a_long_function_is_noticed(head: str) -> None:
    indent = " " * (len(head) - len(head.lstrip()))
    body = f"{indent}    if (a) {{\n{indent}        b();\n{indent}    }}\n"
    long, short = (f"struct S {{\n{head}\n{body * count}{indent}}}\n}};\n" for count in (20, 10))
    assert (long_functions(long), long_functions(short)) == ([head.split("\n", maxsplit=1)[0]], [])


@pytest.mark.parametrize("path", SOURCES, ids=NAMES)
def test_each_room_has_its_namespace(path: Path) -> None:
    folder = path.parent.relative_to(CORE)
    room = "ffseg" if folder.name == "common" else f"ffseg::{folder.name}"
    assert set(re.findall(r"^namespace ([\w:]+) \{", path.read_text("utf-8"), re.M)) <= {room}
