"""A strict reader of small YAML files that remembers the line of every key and value.

It takes the JSON-like heart of YAML 1.2 and refuses the rest by name: aliases, anchors, merge keys, tags, duplicate
keys, several documents, deep nesting and large files. Scalars follow the YAML 1.2 core schema: ``1e-3`` is a number,
``012`` is twelve, ``yes`` and ``1:30`` are strings.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field

import yaml

from ffseg.schema.nodes import Node, Problems, Source, shown_key

MAX_BYTES = 1_000_000
MAX_DEPTH = 20
MAX_VALUES = 20_000
"""Bounds the time a hostile file takes; the largest real one (hundreds of start circles) has some thousands."""
MAX_DIGITS = 400
"""No finite double has more digits before its point; converting longer ones takes quadratic time."""

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_UNPRINTABLE = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: dict[str, bool | None] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
}


def read(path: str | os.PathLike[str], problems: Problems) -> Node:
    """Read a YAML file whose document is a mapping.

    Parameters
    ----------
    path : path
        A regular file of at most 1 MB in UTF-8; anything else is a problem, never a wait.
    problems : Problems
        Receives what is wrong, each with ``file:line``.

    Returns
    -------
    Node
        The mapping; an empty one for an empty file or when the file cannot be used.
    """
    source = Source(os.fspath(path), os.path.dirname(os.fspath(path)))
    text = read_text(path, problems)
    root = parse(text, source, problems)
    if root.value is None:
        return Node({}, source, 1, 1)
    if not isinstance(root.value, dict):
        problems.add(root.where, "the file must be a mapping of keys to values, such as 'contour: {degree: 3}'")
        return Node({}, source, 1, 1)
    return root


def parse(text: str, source: Source, problems: Problems) -> Node:
    """Parse one YAML document; the value of the returned node is None where it is empty or unusable."""
    bad = _UNPRINTABLE.search(text)
    if bad:
        line = text.count("\n", 0, bad.start()) + 1
        problems.add(f"{source.name}:{line}", f"character U+{ord(bad[0]):04X} is not allowed in YAML; remove it")
        return Node(None, source)
    builder = _Builder(source, problems)
    try:
        for event in _events(text):
            builder.take(event)
    except _RefusedError as refused:
        problems.add(builder.place(refused.line), str(refused))
        return Node(None, source)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        last = len(text.splitlines())
        problems.add(builder.place(min(mark.line + 1, last) if mark else 0), f"not valid YAML: {error.problem}")
        return Node(None, source)
    return builder.root or Node(None, source)


def scalar(text: str) -> bool | int | float | str | None:
    """Resolve a plain scalar by the YAML 1.2 core schema."""
    if text in _WORDS:
        return _WORDS[text]
    if len(text) > MAX_DIGITS:
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    if _BASED.fullmatch(text):
        return int(text, 0)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INFINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    return text


class _RefusedError(Exception):
    """A file is refused as a whole at `line`."""

    def __init__(self, line: int, text: str) -> None:
        super().__init__(text)
        self.line = line


@dataclass(slots=True)
class _Open:
    """A mapping or sequence whose end has not been seen."""

    line: int
    keyed: bool
    values: dict[str, Node] = field(default_factory=dict)
    items: list[Node] = field(default_factory=list)
    key: str | None = None
    key_line: int = 0


class _Builder:
    """Builds nodes from parser events with its own stack: depth costs no recursion."""

    def __init__(self, source: Source, problems: Problems) -> None:
        self.root: Node | None = None
        self._source = source
        self._problems = problems
        self._stack: list[_Open] = []
        self._count = 0

    def place(self, line: int) -> str:
        """``file:line``, or the bare name of a source that is one line."""
        return f"{self._source.name}:{line}" if line and self._source.folder is not None else self._source.name

    def take(self, event: yaml.Event) -> None:
        """Take one parser event."""
        mark = event.start_mark
        line = mark.line + 1 if mark else 0
        if isinstance(event, yaml.NodeEvent):
            self._refuse(event, line)
        if isinstance(event, yaml.ScalarEvent):
            self._scalar(event, line)
        elif isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            self._open(event, line)
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            self._close()
        elif isinstance(event, yaml.DocumentStartEvent) and self.root is not None:
            raise _RefusedError(line, "a second document begins here; write one document per file")

    def _refuse(self, event: yaml.NodeEvent, line: int) -> None:
        self._count += 1
        if self._count > MAX_VALUES:
            raise _RefusedError(line, f"more than {MAX_VALUES} keys and values; parameter files are smaller")
        if isinstance(event, yaml.AliasEvent):
            raise _RefusedError(line, f"alias '*{shown_key(str(event.anchor))}' is not supported; write the value out")
        if event.anchor is not None:
            name = shown_key(event.anchor)
            raise _RefusedError(line, f"anchor '&{name}' is not supported; write the value where it is used")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise _RefusedError(line, f"tag '{shown_key(tag)}' is not supported; write the plain value")

    def _scalar(self, event: yaml.ScalarEvent, line: int) -> None:
        parent = self._stack[-1] if self._stack else None
        if parent and parent.keyed and parent.key is None:
            self._key(parent, event, line)
            return
        value = scalar(event.value) if event.implicit[0] and event.style in (None, "") else event.value
        self._place_value(value, line)

    def _key(self, parent: _Open, event: yaml.ScalarEvent, line: int) -> None:
        if event.value == "<<" and not event.style:
            raise _RefusedError(line, "merge key '<<' is not supported; write the keys out")
        if event.value in parent.values:
            first = self.place(parent.values[event.value].key_line)
            name = shown_key(event.value)
            self._problems.add(self.place(line), f"{name}: the key is given twice (first at {first}); keep one")
        parent.key, parent.key_line = event.value, line

    def _open(self, event: yaml.CollectionStartEvent, line: int) -> None:
        if len(self._stack) >= MAX_DEPTH:
            raise _RefusedError(line, f"nested deeper than {MAX_DEPTH} levels")
        if self._stack and self._stack[-1].keyed and self._stack[-1].key is None:
            raise _RefusedError(line, "a key must be a plain word, not a list or mapping")
        self._stack.append(_Open(line, isinstance(event, yaml.MappingStartEvent)))

    def _close(self) -> None:
        done = self._stack.pop()
        self._place_value(done.values if done.keyed else tuple(done.items), done.line)

    def _place_value(self, value: object, line: int) -> None:
        shown_line = line if self._source.folder is not None else 0
        if not self._stack:
            self.root = Node(value, self._source, shown_line, shown_line)
            return
        parent = self._stack[-1]
        if parent.keyed and parent.key is not None:
            key_line = parent.key_line if shown_line else 0
            parent.values[parent.key] = Node(value, self._source, shown_line, key_line)
            parent.key = None
        else:
            parent.items.append(Node(value, self._source, shown_line, shown_line))


def _events(text: str) -> Iterator[yaml.Event]:
    yield from yaml.parse(text, Loader=_LOADER)


def read_text(path: str | os.PathLike[str], problems: Problems, max_bytes: int = MAX_BYTES) -> str:
    """Read at most so many bytes of UTF-8 from a regular file without waiting on pipes or devices; empty after a problem."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
        try:
            regular = stat.S_ISREG(os.fstat(handle).st_mode)
            data = _read_bytes(handle, max_bytes + 1) if regular else None
        finally:
            os.close(handle)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a usable file name"
        problems.add(os.fspath(path), f"cannot be read ({reason}); check the path")
        return ""
    if data is None:
        problems.add(os.fspath(path), "not a regular file; give a text file")
        return ""
    return _decode(os.fspath(path), data, problems, max_bytes)


def _read_bytes(handle: int, most: int) -> bytes:
    data = bytearray()
    while len(data) < most and (part := os.read(handle, most - len(data))):
        data += part
    return bytes(data)


def _decode(path: str, data: bytes, problems: Problems, max_bytes: int) -> str:
    if len(data) > max_bytes:
        problems.add(path, f"larger than {max_bytes} bytes, the most that is read; give a smaller file")
        return ""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        problems.add(f"{path}:{line}", "not UTF-8 text; save the file as UTF-8")
        return ""
