"""OpenCV's YAML and XML storage files, read as text: only what an omnidirectional calibration needs."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any
from xml.parsers import expat

from ffseg.schema.nodes import Node, Origin, Problems
from ffseg.schema.strict_yaml import parse, scalar

MAX_DEPTH = 20
MAX_ELEMENTS = 20_000
MAX_SIDE = 65_500
MATRIX_KEYS = ("camera_matrix", "K", "cameraMatrix", "Camera_Matrix")
DISTORTION_KEYS = ("distortion_coefficients", "D", "distCoeffs", "Distortion_Coefficients")
WIDTH_KEYS = ("image_width", "width", "image_Width")
HEIGHT_KEYS = ("image_height", "height", "image_Height")
_TAG = re.compile(r":[ \t]*!!opencv-matrix[ \t]*$", re.MULTILINE)
_LIMIT = 1e6
"""No length, coefficient or size in a calibration is larger."""


@dataclass(frozen=True, slots=True)
class Values:
    """What was found under OpenCV's names."""

    name: str
    size: tuple[int, int]
    matrix: tuple[tuple[float, ...], ...]
    distortion: tuple[float, ...]
    xi: float | None
    fisheye: bool


def looks_like(text: str) -> bool:
    """True for a file that FileStorage has written."""
    start = text.lstrip()
    return start.startswith(("%YAML:1.0", "%YAML 1.0", "<?xml", "<opencv_storage")) or "!!opencv-matrix" in text


def read(text: str, source: Origin, problems: Problems) -> Values | None:
    """Read the calibration; None with the problems noted."""
    root = _xml(text, source, problems) if text.lstrip().startswith("<") else _yaml(text, source, problems)
    if problems.lines or not isinstance(root.value, dict):
        if not problems.lines:
            problems.add(source.name, "the file holds no keys; expected camera_matrix, distortion_coefficients, ...")
        return None
    values: dict[str, Node] = root.value
    size = tuple(_integer(values, keys, source, problems) for keys in (WIDTH_KEYS, HEIGHT_KEYS))
    matrix = _required_matrix(values, MATRIX_KEYS, source, problems)
    distortion = _required_matrix(values, DISTORTION_KEYS, source, problems)
    xi = _matrix(values["xi"], "xi", problems) if "xi" in values else ()
    if xi and (len(xi) != 1 or len(xi[0]) != 1 or not 0 <= xi[0][0] <= 100):
        problems.add(values["xi"].where, "xi: must be one number from 0 to 100")
    if matrix and (len(matrix) != 3 or len(matrix[0]) != 3):
        problems.add(source.name, f"{MATRIX_KEYS[0]}: {len(matrix)}x{len(matrix[0])}, must be 3x3")
    if problems.lines:
        return None
    fisheye = "fisheye_model" in values and _matrix(values["fisheye_model"], "fisheye_model", problems) == ((1.0,),)
    flat = tuple(value for row in distortion for value in row)
    return Values(source.name, (size[0], size[1]), matrix, flat, xi[0][0] if xi else None, fisheye)


def _yaml(text: str, source: Origin, problems: Problems) -> Node:
    """FileStorage's dialect as plain YAML: its directive line and its one tag are taken off."""
    lines = text.lstrip().split("\n", 1)
    if lines[0].startswith("%YAML"):
        text = "\n" + (lines[1] if len(lines) > 1 else "")
    return parse(_TAG.sub(":", text), source, problems)


def _required_matrix(
    values: dict[str, Node], keys: tuple[str, ...], source: Origin, problems: Problems
) -> tuple[tuple[float, ...], ...]:
    for key in keys:
        if key in values:
            return _matrix(values[key], key, problems)
    problems.add(source.name, f"{keys[0]}: missing; it must be an opencv-matrix")
    return ()


def _matrix(node: Node, key: str, problems: Problems) -> tuple[tuple[float, ...], ...]:
    """Rows of an opencv-matrix, a number or a list of numbers; () with the problem noted."""
    value: Any = node.value
    if not isinstance(value, dict):
        numbers = _numbers(value if isinstance(value, tuple) else (node,))
        return (numbers,) if numbers else _bad(node, key, "must be finite numbers", problems)
    missing = {"rows", "cols", "data"} - set(value)
    if missing:
        return _bad(node, key, f"the matrix lacks {', '.join(sorted(missing))}", problems)
    shape = _numbers((value["rows"], value["cols"]))
    data = value["data"].value
    numbers = _numbers(data if isinstance(data, tuple) else (value["data"],))
    if shape is None or numbers is None:
        return _bad(node, key, "must be finite numbers", problems)
    rows, columns = int(shape[0]), int(shape[1])
    if rows < 1 or columns < 1 or rows * columns != len(numbers):
        return _bad(node, key, f"{rows}x{columns} announced, {len(numbers)} numbers given", problems)
    return tuple(numbers[row * columns : (row + 1) * columns] for row in range(rows))


def _bad(node: Node, key: str, text: str, problems: Problems) -> tuple[tuple[float, ...], ...]:
    problems.add(node.where, f"{key}: {text}")
    return ()


def _numbers(nodes: tuple[Node, ...]) -> tuple[float, ...] | None:
    found = []
    for node in nodes:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not -_LIMIT <= value <= _LIMIT:
            return None
        found.append(float(value))
    return tuple(found)


def _integer(values: dict[str, Node], keys: tuple[str, ...], source: Origin, problems: Problems) -> int:
    for key in keys:
        if key in values:
            value = values[key].value
            if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= MAX_SIDE:
                return value
            problems.add(values[key].where, f"{key}: must be an integer from 1 to {MAX_SIDE}")
            return 1
    problems.add(source.name, f"{keys[0]}: missing; add the image size in pixels")
    return 1


class _RefusedError(Exception):
    """An XML file is refused as a whole."""


@dataclass(slots=True)
class _Element:
    name: str
    line: int
    children: dict[str, Node] = field(default_factory=dict)
    text: list[str] = field(default_factory=list)


class _XmlBuilder:
    """Builds nodes from expat events; no entity, no deep nesting, no repeated key."""

    def __init__(self, source: Origin) -> None:
        self.root: Node | None = None
        self._source = source
        self._stack: list[_Element] = []
        self._count = 0
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _doctype(self, *_: object) -> None:
        raise _RefusedError("document type declarations and entities are not supported; remove them")

    def _start(self, name: str, _: dict[str, str]) -> None:
        self._count += 1
        if len(self._stack) >= MAX_DEPTH or self._count > MAX_ELEMENTS:
            raise _RefusedError(f"nested deeper than {MAX_DEPTH} levels or more than {MAX_ELEMENTS} elements")
        self._stack.append(_Element(name, self.parser.CurrentLineNumber))

    def _text(self, text: str) -> None:
        if self._stack:
            self._stack[-1].text.append(text)

    def _end(self, _: str) -> None:
        done = self._stack.pop()
        node = Node(done.children or _words("".join(done.text), self._source, done.line), self._source, done.line)
        if isinstance(node.value, tuple) and len(node.value) == 1:
            node = node.value[0]
        if not self._stack:
            self.root = node
        elif done.name == "_":  # an item of a list that no calibration key uses
            return
        elif done.name in self._stack[-1].children:
            raise _RefusedError(f"{done.name}: the key is given twice; keep one")
        else:
            self._stack[-1].children[done.name] = node


def _words(text: str, source: Origin, line: int) -> object:
    return tuple(Node(scalar(word), source, line) for word in text.split()) or ""


def _xml(text: str, source: Origin, problems: Problems) -> Node:
    builder = _XmlBuilder(source)
    try:
        builder.parser.Parse(text.encode("utf-8"), True)
    except _RefusedError as refused:
        problems.add(f"{source.name}:{builder.parser.CurrentLineNumber}", str(refused))
    except (expat.ExpatError, ValueError, LookupError) as error:
        problems.add(source.name, f"not valid XML: {error}; write the file again with FileStorage")
    return builder.root or Node(None, source)
