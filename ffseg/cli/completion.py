"""Shell completion of presets, methods, parameter keys, suites and exports."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

LISTED = ","
KINDS = ("mask", "svg", "geojson", "coco", "labelme", "yolo", "overlay", "cutout")
"""What ``ffseg segment`` writes."""


def presets(incomplete: str) -> list[str]:
    """Presets that begin so; none, and so files, where a path is begun."""
    from ffseg.parameter_files import presets as known

    return _starting(known(), incomplete)


def settings(incomplete: str) -> list[str]:
    """``KEY=`` of every parameter, and the words a key takes once it is written."""
    from ffseg.parameters import Parameters
    from ffseg.schema.kinds import Flag, Name, OrWord
    from ffseg.schema.sections import leaves

    known = leaves(Parameters)
    key, equals, value = incomplete.partition("=")
    if not equals:
        return _starting((f"{name}=" for name in known), incomplete)
    kind = known[key].kind if key in known else None
    words: Sequence[str] = ()
    if isinstance(kind, Flag):
        words = ("true", "false")
    elif isinstance(kind, OrWord):
        words = (kind.word,)
    elif isinstance(kind, Name):
        words = kind.choices
    return [f"{key}={word}" for word in _starting(words, value)]


def methods(incomplete: str) -> list[str]:
    """Lists of methods: the last name is completed."""
    from ffseg.plugins import METHODS, installed

    return _listed((*METHODS, *installed("methods"), "peers", "all"), incomplete)


def exports(incomplete: str) -> list[str]:
    """Lists of export formats."""
    from ffseg.plugins import EXPORTS, installed

    return _listed((*EXPORTS, *installed("outputs")), incomplete)


def suites(incomplete: str) -> list[str]:
    """Suites of the bench."""
    return _starting(
        ("patches", "size", "method", "scenes", "peers", "batch", "startup", "memory", "shards"), incomplete
    )


def kinds(incomplete: str) -> list[str]:
    """What one image can be written as."""
    return _starting(KINDS, incomplete)


def _starting(words: Iterable[str], incomplete: str) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]


def _listed(words: Iterable[str], incomplete: str) -> list[str]:
    before, comma, last = incomplete.rpartition(LISTED)
    taken = before.split(LISTED)
    return [f"{before}{comma}{word}" for word in _starting(words, last) if word not in taken]
