"""Sections of declared keys: frozen dataclasses whose fields carry kind, default and description."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from typing import Any, TypeVar, cast

from ffseg.errors import ParameterError
from ffseg.schema.kinds import BAD, Kind
from ffseg.schema.nodes import MAX_PROBLEMS_SHOWN, Node, Origin, Problems, shown, shown_key, wrap

T = TypeVar("T")
S = TypeVar("S", bound="Section")
PYTHON = Origin("parameters")
MAX_PROBLEMS = 200
"""A file with more is not a parameter file; looking on would only take time."""
MAX_KEY_LENGTH = 64
"""Longer words are no slip of the pen, and comparing them takes quadratic time."""
SEE_ALL = "; 'ffseg config show' lists every key"


def declared(default: T, kind: Kind, doc: str) -> T:
    """Declare a key of a section: its default, what it may hold, and what it means."""
    made: T = field(default=default, metadata={"kind": kind, "doc": doc})
    return made


def subsection(section: type[S]) -> S:
    """Declare a section inside the top one; every key of it has its default."""
    made: S = field(default_factory=section, metadata={"section": section})
    return made


@dataclass(frozen=True, slots=True)
class Section:
    """Base of all sections: values are checked when one is made, and cannot be changed afterwards."""

    def __post_init__(self) -> None:
        """Check every declared value.

        Raises
        ------
        ParameterError
            One line for each value that is not allowed.
        """
        problems = Problems()
        for key, kind, _ in declarations(type(self)):
            value = kind.check(wrap(getattr(self, key), PYTHON), key, problems)
            object.__setattr__(self, key, value)
        problems.raise_as(ParameterError)


@dataclass(frozen=True, slots=True)
class Leaf:
    """One declared key.

    Attributes
    ----------
    key : str
        Dotted, such as ``contour.degree``.
    """

    key: str
    kind: Kind
    default: object
    doc: str


def declarations(section: type[Section]) -> tuple[tuple[str, Kind, str], ...]:
    """Name, kind and description of every plain key of a section."""
    return _declarations(cast(Any, section))


@cache
def _declarations(section: Any) -> tuple[tuple[str, Kind, str], ...]:  # noqa: ANN401 - mypy knows no hash of a class
    kept = (item for item in fields(section) if "kind" in item.metadata)
    return tuple((item.name, item.metadata["kind"], item.metadata["doc"]) for item in kept)


def subsections(section: type[Section]) -> dict[str, type[Section]]:
    """Sections inside a section, by key."""
    return {item.name: item.metadata["section"] for item in fields(section) if "section" in item.metadata}


def leaves(section: type[Section], prefix: str = "") -> dict[str, Leaf]:
    """Every plain key of a section and of the sections in it, by dotted key, in the order of declaration."""
    found = {}
    for item in fields(section):
        key = prefix + item.name
        if "section" in item.metadata:
            found.update(leaves(item.metadata["section"], f"{key}."))
        elif item.default is not MISSING:
            found[key] = Leaf(key, item.metadata["kind"], item.default, item.metadata["doc"])
    return found


def collect(section: type[Section], root: Node, problems: Problems, see_all: str = SEE_ALL) -> dict[str, object]:
    """Check a mapping node against a section.

    Parameters
    ----------
    root : Node
        A mapping; keys may be nested or dotted.
    problems : Problems
        Receives unknown keys, each with the nearest known one, and values that are not allowed.
    see_all : str
        Where all keys are listed, said of a key that is near to none.

    Returns
    -------
    dict
        Checked value by dotted key, only for keys given.
    """
    known = leaves(section)
    groups = {key.rpartition(".")[0] for key in known} - {""}
    values: dict[str, object] = {}
    places: dict[str, str] = {}
    for key, node in _flatten(root, "", groups):
        if key in places:
            problems.add(node.key_where, f"{shown_key(key)}: the key is given twice (first at {places[key]}); keep one")
        places[key] = node.key_where
        if len(problems.lines) > MAX_PROBLEMS:
            break
        if key in known:
            value = known[key].kind.check(node, key, problems)
            if value is not BAD:
                values[key] = value
        elif key not in groups:
            is_shown = len(problems.lines) < MAX_PROBLEMS_SHOWN  # looking for the nearest takes a millisecond
            near = nearest(key, [*known, *groups]) if is_shown else ""
            problems.add(node.key_where, f"{shown_key(key)}: unknown key{near or see_all}")
        elif node.value is not None:
            problems.add(node.where, f"{key}: {shown(node.value)} is not a mapping; write {key}.KEY: VALUE")
    return values


def build(section: type[S], values: dict[str, object]) -> S:
    """Make a section from values by dotted key; keys not given have their default."""
    parts: dict[str, object] = {key: value for key, value in values.items() if "." not in key}
    for name, inner in subsections(section).items():
        cut = len(name) + 1
        parts[name] = build(inner, {key[cut:]: value for key, value in values.items() if key.startswith(f"{name}.")})
    return section(**parts)


def flat(value: Section, prefix: str = "") -> dict[str, object]:
    """Values of a section by dotted key, in the order of declaration."""
    found: dict[str, object] = {}
    for item in fields(value):
        inner = getattr(value, item.name)
        key = prefix + item.name
        found.update(flat(inner, f"{key}.") if isinstance(inner, Section) else {key: inner})
    return found


def _flatten(node: Node, prefix: str, groups: set[str]) -> Iterator[tuple[str, Node]]:
    """Yield dotted key and node of everything given; only known groups are entered."""
    if not isinstance(node.value, dict):
        return
    for key, child in node.value.items():
        dotted = prefix + key
        if dotted in groups and isinstance(child.value, dict):
            yield from _flatten(child, f"{dotted}.", groups)
        else:
            yield dotted, child


def nearest(key: str, known: list[str]) -> str:
    """Ask ``; did you mean '...'?`` where a known key is near; a dotted key also by its last part."""
    if len(key) > MAX_KEY_LENGTH:
        return ""
    import difflib  # 5 ms that only a wrong key should cost

    last = key.rpartition(".")[2]
    same_name = [name for name in known if name.rpartition(".")[2] == last]
    near = same_name or difflib.get_close_matches(key, known, n=1, cutoff=0.6)
    if not near:
        by_name = {name.rpartition(".")[2]: name for name in known}
        near = [by_name[word] for word in difflib.get_close_matches(last, by_name, n=1, cutoff=0.75)]
    return f"; did you mean '{near[0]}'?" if near else ""
