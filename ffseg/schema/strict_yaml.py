"""A strict reader of small YAML files that remembers the line of every key and value.

It takes the JSON-like heart of YAML 1.2 and refuses the rest by name: aliases, anchors, merge keys, tags, duplicate
keys, several documents, deep nesting and large files. Scalars follow the YAML 1.2 core schema: ``1e-3`` is a number,
``012`` is twelve, ``yes`` and ``1:30`` are strings.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable

import yaml

from ffseg.schema.nodes import Node, Origin, Problems, shown_key
from ffseg.schema.strict_text import read_text

MAX_DEPTH = 20
TOO_DEEP = f"nested deeper than {MAX_DEPTH} levels"
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
    source = Origin(os.fspath(path), os.path.dirname(os.fspath(path)))
    text = read_text(path, problems)
    root = parse(text, source, problems)
    if root.value is None:
        return Node({}, source, 1, 1)
    if not isinstance(root.value, dict):
        problems.add(root.where, "the file must be a mapping of keys to values, such as 'contour: {degree: 3}'")
        return Node({}, source, 1, 1)
    return root


def parse(text: str, source: Origin, problems: Problems) -> Node:
    """Parse one YAML document; the value of the returned node is None where it is empty or unusable."""
    bad = _UNPRINTABLE.search(text)
    if bad:
        line = text.count("\n", 0, bad.start()) + 1
        problems.add(f"{source.name}:{line}", f"character U+{ord(bad[0]):04X} is not allowed in YAML; remove it")
        return Node(None, source)
    try:
        _refuse_foreign(yaml.parse(text, Loader=_LOADER))
        root = yaml.compose(text, Loader=_LOADER)
        return Node(None, source) if root is None else _node(root, source, problems)
    except _RefusedError as refused:
        problems.add(_placed(source, refused.line), str(refused))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = min(mark.line + 1, len(text.splitlines())) if mark else 0
        # Where libyaml looks ahead, it meets its own limit before the first event.
        deep = "nesting depth" in str(error.problem)
        problems.add(_placed(source, line), TOO_DEEP if deep else f"not valid YAML: {error.problem}")
    return Node(None, source)


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


def _refuse_foreign(events: Iterable[yaml.Event]) -> None:
    """Refuse what is not read, before anything is built of it: it may be as deep and as large as it likes."""
    depth = count = documents = 0
    for event in events:
        line = event.start_mark.line + 1 if event.start_mark else 0
        documents += isinstance(event, yaml.DocumentStartEvent)
        if documents > 1:
            raise _RefusedError(line, "a second document begins here; write one document per file")
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if not isinstance(event, yaml.NodeEvent):
            continue
        count += 1
        if count > MAX_VALUES:
            raise _RefusedError(line, f"more than {MAX_VALUES} keys and values; parameter files are smaller")
        if isinstance(event, yaml.AliasEvent):
            raise _RefusedError(line, f"alias '*{shown_key(str(event.anchor))}' is not supported; write the value out")
        if event.anchor is not None:
            name = shown_key(event.anchor)
            raise _RefusedError(line, f"anchor '&{name}' is not supported; write the value where it is used")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise _RefusedError(line, f"tag '{shown_key(tag)}' is not supported; write the plain value")
        depth += isinstance(event, yaml.CollectionStartEvent)
        if depth > MAX_DEPTH:
            raise _RefusedError(line, TOO_DEEP)


def _node(parsed: yaml.Node, source: Origin, problems: Problems, key_line: int = 0) -> Node:
    """What was parsed as a value that knows its place."""
    line = parsed.start_mark.line + 1 if source.folder is not None else 0
    value: object = None
    if isinstance(parsed, yaml.ScalarNode):
        value = parsed.value if parsed.style else scalar(parsed.value)
    elif isinstance(parsed, yaml.SequenceNode):
        value = tuple(_node(item, source, problems) for item in parsed.value)
    elif isinstance(parsed, yaml.MappingNode):
        value = _mapping(parsed, source, problems)
    return Node(value, source, line, key_line or line)


def _mapping(parsed: yaml.MappingNode, source: Origin, problems: Problems) -> dict[str, Node]:
    values: dict[str, Node] = {}
    for key, child in parsed.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise _RefusedError(line, "a key must be a plain word, not a list or mapping")
        if key.value == "<<" and not key.style:
            raise _RefusedError(line, "merge key '<<' is not supported; write the keys out")
        where, first = _placed(source, line), values.get(key.value)
        if first is not None:
            name = shown_key(key.value)
            problems.add(where, f"{name}: the key is given twice (first at {first.key_where}); keep one")
        values[key.value] = _node(child, source, problems, line if source.folder is not None else 0)
    return values


def _placed(source: Origin, line: int) -> str:
    """``file:line``, or the bare name of a source that is one line."""
    return f"{source.name}:{line}" if line and source.folder is not None else source.name
