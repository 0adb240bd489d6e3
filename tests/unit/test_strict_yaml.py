"""The strict YAML reader: scalars by the YAML 1.2 core schema, places, refusals."""

import math
import os
from pathlib import Path

import pytest

from ffseg.schema.nodes import Node, Origin, Problems
from ffseg.schema.strict_yaml import MAX_DEPTH, parse, read


def parsed(text: str) -> tuple[Node, list[str]]:
    problems = Problems()
    return parse(text, Origin("f.yaml", ""), problems), problems.lines


# YAML 1.2.2, section 10.3.2 (core schema)
FLOATS = [("1e-3", 1e-3), ("1E3", 1000.0), ("-.5", -0.5), ("5.", 5.0), (".inf", math.inf), ("-.INF", -math.inf)]
INTEGERS = [("+12", 12), ("012", 12), ("0o14", 12), ("0xC", 12), ("-0", 0)]
WORDS = [("true", True), ("FALSE", False), ("~", None), ("Null", None)]
TEXTS = [(text, text) for text in ("1:30", "1_000", "yes", "off", "0b11", "-0x1", "2026-11-21")]
QUOTED = [("'1'", "1"), ('"true"', "true"), ("''", "")]


@pytest.mark.parametrize(("text", "value"), [*FLOATS, *INTEGERS, *WORDS, *TEXTS, *QUOTED])
def test_scalar(text: str, value: object) -> None:
    node, problems = parsed(text)
    assert (problems, node.value) == ([], value)
    assert type(node.value) is type(value)


def test_not_a_number_is_read_as_one() -> None:
    value = parsed(".NaN")[0].value
    assert isinstance(value, float)
    assert math.isnan(value)


def test_every_key_and_value_has_its_line() -> None:
    node, problems = parsed("# comment\na:\n  b: 1\n\n  c:\n    - 2\n    - 3\n")
    assert problems == []
    assert isinstance(node.value, dict)
    a = node.value["a"]
    assert (a.key_line, a.line) == (2, 3)
    assert a.value["b"].where == "f.yaml:3"
    assert (a.value["c"].key_line, [item.line for item in a.value["c"].value]) == (5, [6, 7])


def test_depth_limit_is_reached_exactly() -> None:
    assert parsed("[" * MAX_DEPTH + "]" * MAX_DEPTH)[1] == []
    assert "nested deeper" in parsed("[" * (MAX_DEPTH + 1) + "]" * (MAX_DEPTH + 1))[1][0]


def test_duplicate_keys_are_all_reported() -> None:
    problems = parsed("a: 1\nb: 2\na: 3\nb: 4\n")[1]
    assert [line.split(": ")[:2] for line in problems] == [["f.yaml:3", "a"], ["f.yaml:4", "b"]]


def test_one_line_source_has_no_line_number() -> None:
    problems = Problems()
    parse("[1", Origin("--set x=[1"), problems)
    assert problems.lines[0].startswith("--set x=[1: not valid YAML")


def test_empty_file_is_an_empty_mapping(tmp_path: Path) -> None:
    file = tmp_path / "empty.yaml"
    file.write_bytes(b"\xef\xbb\xbf# nothing but a byte order mark\r\n")
    problems = Problems()
    assert (read(file, problems).value, problems.lines) == ({}, [])


@pytest.mark.parametrize("kind", ["absent", "folder", "pipe", "device", "loop", "nul"])
def test_what_is_no_regular_file_is_refused_without_waiting(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path)
    name = {"device": "/dev/zero", "nul": "a\0.yaml"}.get(kind, os.fspath(path))
    problems = Problems()
    assert (read(name, problems).value, len(problems.lines)) == ({}, 1)
    assert problems.lines[0].startswith(f"{name}: ")


def test_no_file_handle_is_left_open(tmp_path: Path) -> None:
    if not os.path.isdir("/proc/self/fd"):
        pytest.skip("no /proc to count open files in")
    before = set(os.listdir("/proc/self/fd"))
    for _ in range(20):
        read(tmp_path, Problems())
    assert set(os.listdir("/proc/self/fd")) <= before  # what earlier tests have left may be closed meanwhile
