"""Values that remember where they were written, and a list of problems with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ffseg.errors import FfsegError

MAX_PROBLEMS_SHOWN = 20
"""More lines than this scroll the first, most useful one off a terminal."""
MAX_VALUE_SHOWN = 48


@dataclass(frozen=True, slots=True)
class Origin:
    """What values were read from.

    Attributes
    ----------
    name : str
        A file name, ``--set KEY=VALUE`` or ``overrides``.
    folder : str or None
        Folder against which relative paths in it are resolved; None leaves them to the working directory.
    """

    name: str
    folder: str | None = None


@dataclass(frozen=True, slots=True)
class Node:
    """A value and the place it was written at.

    Attributes
    ----------
    value : object
        A scalar, a tuple of nodes, or a dict of nodes by key.
    source : Origin
    line, key_line : int
        Lines of the value and of its key, from 1; 0 where the source has no lines.
    """

    value: object
    source: Origin
    line: int = 0
    key_line: int = 0

    @property
    def where(self) -> str:
        """``file:line`` of the value."""
        return f"{self.source.name}:{self.line}" if self.line else self.source.name

    @property
    def key_where(self) -> str:
        """``file:line`` of the value's key."""
        return f"{self.source.name}:{self.key_line}" if self.key_line else self.source.name

    def plain(self) -> object:
        """The value without places: scalars, lists and dicts."""
        if isinstance(self.value, dict):
            return {key: child.plain() for key, child in self.value.items()}
        if isinstance(self.value, tuple):
            return [child.plain() for child in self.value]
        return self.value


def wrap(value: object, source: Origin) -> Node:
    """Turn a Python value into a node; tuples, lists and arrays become tuples of nodes."""
    if isinstance(value, Mapping):
        return Node({str(key): wrap(child, source) for key, child in value.items()}, source)
    if hasattr(value, "tolist"):  # a NumPy array or scalar, without importing NumPy
        value = value.tolist()
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return Node(tuple(wrap(child, source) for child in value), source)
    return Node(value, source)


def shown(value: object) -> str:
    """Write a value as a YAML user would, shortened and without control characters."""
    if value is None or isinstance(value, bool):
        text = {None: "null", True: "true", False: "false"}[value]
    elif isinstance(value, str):
        text = repr(value[: MAX_VALUE_SHOWN + 1])
    elif isinstance(value, Node):
        return shown(value.value)
    elif isinstance(value, dict):
        return "a mapping"
    elif isinstance(value, tuple | list):
        text = "[" + ", ".join(shown(item) for item in value[:MAX_VALUE_SHOWN]) + "]"
    elif isinstance(value, int) and abs(value) >= 10**MAX_VALUE_SHOWN:
        return "a huge integer"
    else:
        text = repr(value)
    return text if len(text) <= MAX_VALUE_SHOWN else text[:MAX_VALUE_SHOWN] + "…"


def shown_key(key: str) -> str:
    """Write a key as it stands, shortened and without control characters."""
    text = key if key.isprintable() else repr(key)[1:-1]
    return text if len(text) <= 2 * MAX_VALUE_SHOWN else text[: 2 * MAX_VALUE_SHOWN] + "…"


class Problems:
    """What is wrong with a set of values, gathered so that all of it is said at once."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, where: str, text: str) -> None:
        """Note one problem: ``where: text``."""
        self.lines.append(f"{where}: {text}")

    def raise_as(self, error: type[FfsegError]) -> None:
        """Raise `error` with one line per problem; do nothing when there is none."""
        if not self.lines:
            return
        lines = list(dict.fromkeys(self.lines))
        kept = lines[:MAX_PROBLEMS_SHOWN]
        if len(lines) > len(kept):
            kept.append(f"... and {len(lines) - len(kept)} more problems")
        raise error("\n".join(kept))
