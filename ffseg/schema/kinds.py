"""Kinds of values: what a key may hold, how it is checked, and its description for people and editors."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Literal, Protocol

from ffseg.schema.nodes import Node, Problems, shown

JsonSchema = dict[str, object]
BAD = object()
"""What `check` returns for a value it has reported as a problem."""
MAX_NUMBER = 1e300
"""Larger numbers, infinity among them, overflow as soon as something is computed with them."""
_TRUE_WORDS = {"yes": "true", "on": "true", "y": "true", "no": "false", "off": "false", "n": "false"}


class Kind(Protocol):
    """What a key may hold."""

    def check(self, node: Node, key: str, problems: Problems) -> object:
        """Return the checked value, or note a problem and return `BAD`."""
        ...

    def allowed(self) -> str:
        """Say what is allowed, to follow "is not"."""
        ...

    def json_schema(self) -> JsonSchema:
        """JSON Schema (draft 7) of the value."""
        ...


@dataclass(frozen=True, slots=True)
class Flag:
    """True or false."""

    def check(self, node: Node, key: str, problems: Problems) -> object:
        if isinstance(node.value, bool):
            return node.value
        word = _TRUE_WORDS.get(str(node.value).lower())
        return _reject(self, node, key, problems, f"; write {word}" if word else "")

    def allowed(self) -> str:
        return "true or false"

    def json_schema(self) -> JsonSchema:
        return {"type": "boolean"}


@dataclass(frozen=True, slots=True)
class Integer:
    """An integer from `low` to `high`."""

    low: int
    high: int

    def check(self, node: Node, key: str, problems: Problems) -> object:
        value = node.value
        if isinstance(value, int) and not isinstance(value, bool) and self.low <= value <= self.high:
            return value
        return _reject(self, node, key, problems)

    def allowed(self) -> str:
        return f"an integer from {self.low} to {self.high}"

    def json_schema(self) -> JsonSchema:
        return {"type": "integer", "minimum": self.low, "maximum": self.high}


@dataclass(frozen=True, slots=True)
class Number:
    """A finite number: at least `low` (more than `low` where `above`) and at most `high`."""

    low: float = -math.inf
    high: float = math.inf
    above: bool = False

    def check(self, node: Node, key: str, problems: Problems) -> object:
        value = node.value
        if isinstance(value, bool) or not isinstance(value, int | float):
            return _reject(self, node, key, problems)
        fits = (self.low < value if self.above else self.low <= value) and value <= self.high
        if not fits or abs(value) > MAX_NUMBER:
            return _reject(self, node, key, problems)
        return float(value)

    def allowed(self) -> str:
        low, high = f"{self.low:g}", f"{self.high:g}"
        if math.isinf(self.low) and math.isinf(self.high):
            return "a finite number"
        if math.isinf(self.high):
            return f"a finite number above {low}" if self.above else f"a finite number of at least {low}"
        return f"a number above {low} and up to {high}" if self.above else f"a number from {low} to {high}"

    def json_schema(self) -> JsonSchema:
        schema: JsonSchema = {"type": "number"}
        if math.isfinite(self.low):
            schema["exclusiveMinimum" if self.above else "minimum"] = self.low
        if math.isfinite(self.high):
            schema["maximum"] = self.high
        return schema


@dataclass(frozen=True, slots=True)
class Text:
    """A non-empty text; with `choices`, one of them."""

    choices: tuple[str, ...] = ()

    def check(self, node: Node, key: str, problems: Problems) -> object:
        value = node.value
        if isinstance(value, str) and value and "\0" not in value and (not self.choices or value in self.choices):
            return value
        near = nearest_word(value, self.choices) if isinstance(value, str) and self.choices else ""
        return _reject(self, node, key, problems, near)

    def allowed(self) -> str:
        return one_of(self.choices) if self.choices else "a text"

    def json_schema(self) -> JsonSchema:
        return {"type": "string", "enum": list(self.choices)} if self.choices else {"type": "string", "minLength": 1}


@dataclass(frozen=True, slots=True)
class Name:
    """One of some names, or ``module:function`` for a function of the user's own.

    Attributes
    ----------
    installed : callable, optional
        Gives further names, where none of the choices is meant.
    """

    choices: tuple[str, ...]
    installed: Callable[[], Collection[str]] = tuple

    def check(self, node: Node, key: str, problems: Problems) -> object:
        value = node.value
        if isinstance(value, str) and (value in self.choices or names_code(value) or value in self.installed()):
            return value
        near = nearest_word(value, (*self.choices, *self.installed())) if isinstance(value, str) else ""
        return _reject(self, node, key, problems, near)

    def allowed(self) -> str:
        return f"one of {', '.join(self.choices)}, or module:function"

    def json_schema(self) -> JsonSchema:
        return {"anyOf": [{"enum": list(self.choices)}, {"type": "string", "pattern": f"^{_OWN_FUNCTION.pattern}$"}]}


def names_code(value: str) -> bool:
    """Whether a name is ``module:function``, which imports a module."""
    return _OWN_FUNCTION.fullmatch(value) is not None


_OWN_FUNCTION = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*:[A-Za-z_][A-Za-z0-9_]*")


def nearest_word(word: str, choices: tuple[str, ...]) -> str:
    """Ask ``; did you mean '...'?`` where one of the choices is near."""
    import difflib  # 5 ms that only a wrong word should cost

    near = difflib.get_close_matches(word[:_MAX_WORD], choices, n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else ""


_MAX_WORD = 100


@dataclass(frozen=True, slots=True)
class FilePath:
    """The name of a file, or null; relative to the YAML file it is written in, else to the working directory."""

    def check(self, node: Node, key: str, problems: Problems) -> object:
        value = os.fspath(node.value) if isinstance(node.value, os.PathLike) else node.value
        if value is None:
            return None
        if not isinstance(value, str) or not value or "\0" in value:
            return _reject(self, node, key, problems)
        return os.path.normpath(os.path.join(node.source.folder, value)) if node.source.folder else value

    def allowed(self) -> str:
        return "a file name or null"

    def json_schema(self) -> JsonSchema:
        return {"type": ["string", "null"], "minLength": 1}


@dataclass(frozen=True, slots=True)
class Row:
    """Named numbers such as ``[x, y, radius]``, all or the first `fewest` at least, in an `order`."""

    names: tuple[str, ...]
    parts: tuple[Number, ...]
    order: Literal["", "ascending", "ascending and apart"] = ""
    fewest: int = 0

    def check(self, node: Node, key: str, problems: Problems) -> object:
        items = node.value
        if not isinstance(items, tuple) or not (self.fewest or len(self.parts)) <= len(items) <= len(self.parts):
            return _reject(self, node, key, problems)
        named = zip(self.parts, items, self.names, strict=False)
        values = tuple(part.check(item, f"{key}, {name}", problems) for part, item, name in named)
        if BAD in values:
            return BAD
        order = sorted(set(values) if "apart" in self.order else values)  # type: ignore[type-var]
        if self.order and list(values) != order:
            return _reject(self, node, key, problems)
        return values

    def allowed(self) -> str:
        order = f", {self.order}" if self.order else ""
        each = {part.allowed() for part in self.parts}
        ranges = f", each {each.pop()}" if len(each) == 1 else ""
        lengths = range(self.fewest or len(self.names), len(self.names) + 1)
        return " or ".join(f"[{', '.join(self.names[:count])}]" for count in lengths) + ranges + order

    def json_schema(self) -> JsonSchema:
        count = len(self.parts)
        items = [part.json_schema() for part in self.parts]
        fewest = self.fewest or count
        return {"type": "array", "items": items, "additionalItems": False, "minItems": fewest, "maxItems": count}


@dataclass(frozen=True, slots=True)
class Many:
    """A list of at most `most` values of one kind; of equal ones the first counts, if they are to be distinct."""

    part: Kind
    most: int
    distinct: bool = True

    def check(self, node: Node, key: str, problems: Problems) -> object:
        items = node.value
        if not isinstance(items, tuple) or len(items) > self.most:
            return _reject(self, node, key, problems)
        values = tuple(self.part.check(item, f"{key}[{index}]", problems) for index, item in enumerate(items))
        if BAD in values:
            return BAD
        return tuple(dict.fromkeys(values)) if self.distinct else values

    def allowed(self) -> str:
        return f"a list of at most {self.most} x {self.part.allowed()}"

    def json_schema(self) -> JsonSchema:
        return {"type": "array", "items": self.part.json_schema(), "maxItems": self.most}


@dataclass(frozen=True, slots=True)
class OrWord:
    """A value of a kind, or one word such as ``auto``."""

    word: str
    other: Kind

    def check(self, node: Node, key: str, problems: Problems) -> object:
        if node.value == self.word:
            return self.word
        if isinstance(node.value, str):
            return _reject(self, node, key, problems)
        return self.other.check(node, key, problems)

    def allowed(self) -> str:
        return f"{self.other.allowed()}, or {self.word}"

    def json_schema(self) -> JsonSchema:
        return {"anyOf": [{"const": self.word}, self.other.json_schema()]}


def one_of(words: tuple[str, ...]) -> str:
    """Write ``'a', 'b' or 'c'``."""
    quoted = [f"'{word}'" for word in words]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} or {quoted[-1]}"


def _reject(kind: Kind, node: Node, key: str, problems: Problems, remedy: str = "") -> object:
    problems.add(node.where, f"{key}: {shown(node.value)} is not {kind.allowed()}{remedy}")
    return BAD
