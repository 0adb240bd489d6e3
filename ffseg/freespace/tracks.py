"""Tracks: components of successive images that show the same thing, linked by their places on the ground."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ffseg.arrays import Array

MAX_DISTANCE = 0.25
"""Metres between a component and its place predicted by the motion: paint stays within a pixel or two, the visible part
of a box shifts by up to its height over the camera's, with the view."""


def in_earlier_frame(places: Array, planar: Sequence[float]) -> Array:
    """Ground places of the current image, shape (n, 2), in the levelled frame of an earlier camera."""
    c, s = np.cos(planar[2]), np.sin(planar[2])
    result: Array = places @ np.array([[c, s], [-s, c]]) + np.asarray(planar[:2], np.float64)
    return result


def associate(now: Array, before: Array) -> list[int]:
    """For each current place the index of the earlier place of the same thing, or -1.

    Parameters
    ----------
    now, before : ndarray of float64, shape (n, 2) and (m, 2)
        Metres, in one frame. Places that are not finite have no partner.

    Notes
    -----
    Two places are the same thing when each is the nearest of the other and they lie less than ``MAX_DISTANCE`` apart.
    """
    if not len(now) or not len(before):
        return [-1] * len(now)
    apart = np.hypot(*(now[:, None] - before[None]).transpose(2, 0, 1))
    apart = np.where(np.isfinite(apart), apart, np.inf)
    nearest, back = apart.argmin(axis=1), apart.argmin(axis=0)
    rows = range(len(now))
    return [int(nearest[i]) if back[nearest[i]] == i and apart[i, nearest[i]] < MAX_DISTANCE else -1 for i in rows]


class ObstacleTracks:
    """Track numbers along a sequence.

    Numbers count from 0 in the order in which things are first seen; nothing is given a number again.

    Parameters
    ----------
    kept : int, optional
        Images that are remembered; all without it.
    """

    def __init__(self, kept: int | None = None) -> None:
        self._next, self._kept = 0, kept
        self._seen: dict[str, tuple[Array, list[int]]] = {}

    def follow(self, name: str, places: Array, links: Sequence[tuple[str, Sequence[float]]]) -> list[int]:
        """Track numbers of the components of an image.

        Parameters
        ----------
        name : str
            Of the image.
        places : ndarray of float64, shape (n, 2)
            On the ground, in its levelled camera frame, metres.
        links : sequence of (str, (x, y, turn))
            Earlier images and how the ground moved since; the first that was followed counts.
        """
        numbers = [-1] * len(places)
        for before, planar in links:
            if before in self._seen and len(places):
                old, known = self._seen[before]
                partners = associate(in_earlier_frame(places, planar), old)
                numbers = [known[partner] if partner >= 0 else -1 for partner in partners]
                break
        for index, number in enumerate(numbers):
            if number < 0:
                numbers[index], self._next = self._next, self._next + 1
        self._seen[name] = places, numbers
        if self._kept is not None and len(self._seen) > self._kept:
            del self._seen[next(iter(self._seen))]
        return numbers


Line = Mapping[str, Any]


def with_track_numbers(order: Iterable[str], lines: Mapping[str, Sequence[Line]]) -> dict[str, list[dict[str, Any]]]:
    """Rows of ``obstacles.csv`` by image, each with its track number in ``track``.

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
    tracks, found = ObstacleTracks(), {}
    for name in order:
        own = lines.get(name, ())
        places = np.array([[_number(line["ground_x_m"]), _number(line["ground_y_m"])] for line in own]).reshape(-1, 2)
        links = [(str(before), planar) for before, *planar in (own[0]["links"] if own else ())]
        numbers = tracks.follow(name, places, links)
        found[name] = [{**line, "track": number} for line, number in zip(own, numbers, strict=True)]
    return found


def _number(cell: Any) -> float:  # noqa: ANN401 - JSON values
    return float(cell) if isinstance(cell, int | float) else float("nan")
