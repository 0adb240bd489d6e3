"""The things of a sequence numbered in ``obstacles.csv``, once all its images are judged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ffseg.freespace.tracks import Tracks

Line = Mapping[str, Any]


def numbered(order: Iterable[str], lines: Mapping[str, Sequence[Line]]) -> dict[str, list[dict[str, Any]]]:
    """Lines of ``obstacles.csv`` by image, each with the number of its thing as ``track``.

    Parameters
    ----------
    order : iterable of str
        Names of images, each after those it was judged against.
    lines : mapping
        Lines by name: where each component lies on the ground, and the ``links`` to earlier images.

    Notes
    -----
    Images are judged one by one, in any order and on any number of workers; only the numbers need them all.
    """
    tracks, found = Tracks(), {}
    for name in order:
        own = lines.get(name, ())
        places = np.array([[_number(line["ground_x_m"]), _number(line["ground_y_m"])] for line in own]).reshape(-1, 2)
        links = [(str(before), planar) for before, *planar in (own[0]["links"] if own else ())]
        numbers = tracks.follow(name, places, links)
        found[name] = [{**line, "track": number} for line, number in zip(own, numbers, strict=True)]
    return found


def _number(cell: Any) -> float:  # noqa: ANN401 - JSON values
    return float(cell) if isinstance(cell, int | float) else float("nan")
