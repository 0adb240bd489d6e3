"""The settings that tuning tries: an evenly spread, fixed sequence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import exp

from ffseg.evidence.maps import log_odds
from ffseg.parameters import Parameters

Setting = dict[str, object]
"""Overrides by dotted key; an empty one is the parameters as they are."""

SIGMAS = (1.0, 1.5, 2.2, 3.3)
HIGHS = (1.5, 2.2, 3.3, 5.0, 7.5, 11.0, 16.0, 24.0, 36.0)
"""High Canny thresholds, grey levels per pixel, each about half as high again; the low one is half of it."""
CLEARANCES = (0.0, 0.0, 3.0, 6.0, 10.0, 16.0, 24.0)
"""px; none at all is tried twice as often as any other."""
AUTO_FRACTION = 0.2
"""Part of the settings that leave the thresholds to the image."""
LIGHTS = (("linear", 0.0), ("root", 11.0))
"""Grey levels of which gradients are taken, and px of the highlights that are taken out: as they are, or with shade evened out
and without gloss and painted lines."""

MAX_SETTINGS = 240
"""Half of all there are: among more, few masks find others that are no better on the rest."""

BASES = (2, 3, 5, 7, 11)
THRESHOLDS = "edges.canny"
LEVEL = "region.probability"
LEVEL_STEP, LEVEL_STEPS = 0.5, 4
"""Log odds between one level of probability and the next, and levels to each side of the one at hand."""
MIN_LEVEL = 0.01
"""No level is lower, and none higher than the rest to one."""
JUDGED = ("auto", "prior", "model")
"""Edge sources that tell a probability, by which a level can be moved."""
SHARED = "gradient"
"""The edge source whose maps many settings share; one that chooses for itself would not ask for the thresholds."""


def with_setting(params: Parameters, setting: Setting) -> Parameters:
    """The parameters with a setting."""
    for key, value in setting.items():
        section, _, name = key.partition(".")
        params = replace(params, **{section: replace(getattr(params, section), **{name: value})})
    return params


def halton(index: int, base: int) -> float:
    """Number `index` (from 1) of the evenly spread sequence of a base: its digits, mirrored behind the point."""
    value, share = 0.0, 1.0
    while index > 0:
        share /= base
        value += share * (index % base)
        index //= base
    return value


def levels(params: Parameters) -> list[Setting]:
    """Levels of probability round the current one, nearest first, if the parameters use probabilities."""
    if ("model" if params.edges.model is not None else params.edges.source) not in JUDGED:
        return []
    own = params.region.probability
    steps = [sign * step for step in range(1, LEVEL_STEPS + 1) for sign in (1, -1)]
    moved = [1 / (1 + exp(-log_odds(own) - LEVEL_STEP * step)) for step in steps]
    return [{LEVEL: round(level, 2)} for level in moved if MIN_LEVEL <= level <= 1 - MIN_LEVEL]


def settings() -> Iterator[Setting]:
    """The first settings of the sequence, without repetitions."""
    seen: set[tuple[object, ...]] = set()
    index = 0
    while len(seen) < MAX_SETTINGS:
        index += 1
        first, second, third, fourth, fifth = (halton(index, base) for base in BASES)
        high = HIGHS[int(first * len(HIGHS))]
        grey, highlights = LIGHTS[int(fifth * len(LIGHTS))]
        setting: Setting = {
            "edges.source": SHARED,
            THRESHOLDS: "auto" if third < AUTO_FRACTION else (high / 2, high),
            "edges.sigma": SIGMAS[int(second * len(SIGMAS))],
            "contour.clearance": CLEARANCES[int(fourth * len(CLEARANCES))],
            "edges.levels": grey,
            "edges.highlights": highlights,
        }
        key = tuple(map(str, setting.values()))
        if key not in seen:
            seen.add(key)
            yield setting
