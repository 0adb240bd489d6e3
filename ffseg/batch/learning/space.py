"""The settings that tuning tries: spread evenly, the same ones every time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ffseg.parameters import Parameters

Setting = dict[str, object]
"""Overrides by dotted key; an empty one is the parameters as they are."""

SIGMAS = (1.0, 1.5, 2.2, 3.3)
HIGHS = (1.5, 2.2, 3.3, 5.0, 7.5, 11.0, 16.0, 24.0, 36.0)
"""High Canny thresholds, grey levels per pixel, each about half as high again; the low one is half of it."""
CLEARANCES = (0.0, 0.0, 3.0, 6.0, 10.0, 16.0, 24.0)
"""px; none at all is tried twice as often as any other."""
AUTO_SHARE = 0.2
"""Part of the settings that leave the thresholds to the image."""

BASES = (2, 3, 5, 7)
THRESHOLDS = "edges.canny"
SHARED = "gradient"
"""The edge source whose maps many settings share; one that chooses for itself would not ask for the thresholds."""


def applied(params: Parameters, setting: Setting) -> Parameters:
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


def settings() -> Iterator[Setting]:
    """Settings without end, each different from the ones before it."""
    seen: set[tuple[object, ...]] = set()
    index = 0
    while index < MOST_SETTINGS:
        index += 1
        first, second, third, fourth = (halton(index, base) for base in BASES)
        high = HIGHS[int(first * len(HIGHS))]
        setting: Setting = {
            "edges.source": SHARED,
            THRESHOLDS: "auto" if third < AUTO_SHARE else (high / 2, high),
            "edges.sigma": SIGMAS[int(second * len(SIGMAS))],
            "contour.clearance": CLEARANCES[int(fourth * len(CLEARANCES))],
        }
        key = tuple(map(str, setting.values()))
        if key not in seen:
            seen.add(key)
            yield setting


MOST_SETTINGS = 5000
"""Draws after which hardly a setting is new."""
