"""Differences between parameter files of ffseg 0.1 and the current version: old defaults, new keys."""

from __future__ import annotations

from collections.abc import Collection

from ffseg.parameter_text import yaml_value
from ffseg.parameters import Parameters
from ffseg.schema.sections import leaves

OLD_DEFAULTS: dict[str, object] = {
    "method": "freeform",
    "contour.degree": 3,
    "contour.patches": 13,
    "contour.split_threshold": 24.0,
    "contour.balloon": 4.0,
    "contour.refine": True,
    "contour.topology": True,
    "contour.clearance": 0.0,
    "contour.settle": 4.0,
    "contour.max_iterations": 2000,
    "edges.sigma": 1.5,
    "edges.exponent": 2.0,
    "edges.canny": "auto",
    "init.center": "auto",
    "init.radius": 40.0,
    "init.circles": (),
    "init.boxes": (),
    "init.mask": None,
    "domain.mask": None,
    "obstacles.altitude": 0.08,
    "snake.tension": 0.02,
    "snake.rigidity": 0.02,
    "snake.attraction": 2.5,
    "snake.spacing": 6.0,
    "snake.tolerance": 0.05,
    "levelset.stop_speed": "auto",
    "levelset.settle": 6,
    "levelset.min_area": 8.0,
}
"""Keys of 0.1.0 with their defaults, as its ``configs/default.yaml`` had them once all three methods were in it."""
ADDED_KEYS: dict[str, object] = {"edges.source": "gradient", "domain.disc": "off", "input.range": (0.0, 65535.0)}
"""Keys that 0.1 did not have, where the default does something else than 0.1 did."""

CHANGED_KEYS = {
    "init.boxes": "the objects inside them, and where the contour may go; to start only, write init.circles"
}
"""Keys of 0.1 that mean something else now, and what."""


def since_0_1(written: Collection[str]) -> list[str]:
    """Lines that a file of ffseg 0.1 needs to mean what it meant, with the defaults and meanings of now in comments.

    Parameters
    ----------
    written : collection of str
        The dotted keys that the file gives. One that 0.1 did not have makes it a newer file, which needs nothing.
    """
    if not set(written) <= OLD_DEFAULTS.keys():
        return []
    now = {key: leaf.default for key, leaf in leaves(Parameters).items()}
    changed = {key: was for key, was in (OLD_DEFAULTS | ADDED_KEYS).items() if key not in written and now[key] != was}
    lines = [f"{key}: {yaml_value(was)}  # {yaml_value(now[key])} now" for key, was in changed.items()]
    return lines + [f"# {key} means now: {text}" for key, text in CHANGED_KEYS.items() if key in written]
