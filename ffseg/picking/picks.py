"""The picks of an image, and the journal of every step."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ffseg.arrays import Array, Mask
from ffseg.errors import OutputError, UsageError
from ffseg.io.files import OWN, printable, unwritten
from ffseg.io.starts import LIMITS, MAX_PIXELS, Start
from ffseg.parameters import Box, Circle, Point, Seed

STATUSES = ("open", "accepted", "skipped")
MAX_STARTS = 1000
"""Starts of an image that the parameters take; strokes and boxes are no more."""
MAX_POINTS = 20_000
"""Of one stroke: ten minutes of a pen's."""
_DIGEST = re.compile(r"[0-9a-f]{32}|")


@dataclass(frozen=True, slots=True)
class Stroke:
    """A line painted with the brush.

    Attributes
    ----------
    inside : bool
        It adds to the region; else it takes away.
    radius : float
        Pixels.
    points : tuple of (x, y)
        Pixels, at least one.
    """

    inside: bool
    radius: float
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class ImagePicks:
    """What is picked in one image: all that its region is made from.

    Attributes
    ----------
    starts : tuple of (x, y, radius)
        Circles inside, pixels.
    nots : tuple of (x, y, radius) or (x, y, radius, after)
        Circles outside, and how many starts there were before each.
    boxes : tuple of (left, top, right, bottom)
    strokes : tuple of Stroke
        Painted over what is found, in their order.
    probability, clearance : float or None
        In place of the parameters'.
    alike : bool
        All things that look like what is picked are meant.
    status : str
        One of ``STATUSES``.
    base : str
        Digest of the region that an accepted mask was painted on, which is kept; empty where it is to be found.
    """

    starts: tuple[Circle, ...] = ()
    nots: tuple[Seed, ...] = ()
    boxes: tuple[Box, ...] = ()
    strokes: tuple[Stroke, ...] = ()
    probability: float | None = None
    clearance: float | None = None
    alike: bool = False
    status: str = "open"
    base: str = ""

    @property
    def unpainted(self) -> ImagePicks:
        """What the region below the strokes is made from."""
        return replace(self, strokes=(), status="open", base="")

    @property
    def grows(self) -> bool:
        """Whether a contour grows from it, whatever region was there before."""
        return bool(self.starts or self.boxes)

    @property
    def start(self) -> Start | None:
        """As a starts file has it; None where nothing would stand in it."""
        first, *others = [Start(*circle) for circle in dict.fromkeys(self.starts)] or [Start()]
        start = replace(
            first,
            others=tuple(others),
            background=tuple(dict.fromkeys(self.nots)),
            boxes=tuple(dict.fromkeys(self.boxes)),
            probability=self.probability,
            clearance=self.clearance,
            alike=self.alike and self.grows,
        )
        return None if start == Start() else start

    @classmethod
    def read(cls, document: object) -> ImagePicks:
        """From JSON, which `dataclasses.asdict` gives.

        Raises
        ------
        UsageError
            If it is not of that form.
        """
        try:
            if not isinstance(document, Mapping):
                raise TypeError("it is no object")
            values: Mapping[str, Any] = document
            starts, nots, boxes, strokes = (values.get(kind) or () for kind in ("starts", "nots", "boxes", "strokes"))
            if max(map(len, (starts, nots, boxes, strokes))) > MAX_STARTS:
                raise ValueError(f"more than {MAX_STARTS} of one kind")
            picked = cls(
                _rows(starts, {3}),
                _rows(nots, {3, 4}),
                _rows(boxes, {4}),
                tuple(map(_stroke, strokes)),
                _value(values.get("probability"), "probability"),
                _value(values.get("clearance"), "clearance"),
                bool(values.get("alike")),
                values.get("status", "open"),
                values.get("base") or "",
            )
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            raise UsageError(f"what was picked cannot be read ({error}); load the page again") from error
        if picked.status not in STATUSES:
            raise UsageError(f"the status {str(picked.status)[:40]!r} is none of {', '.join(STATUSES)}")
        if not isinstance(picked.base, str) or not _DIGEST.fullmatch(picked.base):
            raise UsageError(f"the region {str(picked.base)[:40]!r} is none that was kept; load the page again")
        return picked


def _number(value: object) -> float:
    number = float(value)  # type: ignore[arg-type]  # what is none raises
    if not math.isfinite(number) or abs(number) > MAX_PIXELS:
        raise ValueError(f"{number:g} is no position")
    return number


def _rows(value: Any, lengths: set[int]) -> Any:  # noqa: ANN401 - tuples of these lengths
    rows = tuple(tuple(_number(one) for one in row) for row in value)
    if any(len(row) not in lengths or (3 in lengths and (row[2] <= 0 or min(row[3:], default=0) < 0)) for row in rows):
        raise ValueError(f"a row needs {min(lengths)} numbers")
    return rows


def _stroke(one: Mapping[str, Any]) -> Stroke:
    points = _rows_of_two(one["points"])
    return Stroke(bool(one["inside"]), max(0.5, _number(one["radius"])), points)


def _rows_of_two(value: Any) -> tuple[Point, ...]:  # noqa: ANN401 - checked here
    points = tuple((_number(x), _number(y)) for x, y in value)
    if not 0 < len(points) <= MAX_POINTS:
        raise ValueError(f"a stroke of {len(points)} points")
    return points


def _value(value: object, kind: str) -> float | None:
    low, high = LIMITS[kind]
    return None if value is None else min(high, max(low, _number(value)))


def paint_strokes(mask: Mask, strokes: tuple[Stroke, ...], factor: float = 1.0) -> Mask:
    """The mask with strokes painted over it, by the pixel-centre rule.

    Parameters
    ----------
    mask : ndarray of bool, shape (H, W)
    factor : float
        Pixels of the image in one of the mask.
    """
    found = mask.copy()
    for stroke in strokes:
        points = (np.array(stroke.points) + 0.5) / factor - 0.5
        for a, b in zip(points, points[1:] if len(points) > 1 else points, strict=False):
            _paint(found, a, b, stroke.radius / factor, stroke.inside)
    return found


def _paint(mask: Mask, a: Array, b: Array, radius: float, value: bool) -> None:
    """Set the pixels within `radius` of the line from a to b."""
    size = np.array(mask.shape[::-1])
    left, top = np.clip(np.floor(np.minimum(a, b) - radius), 0, size).astype(int)
    right, bottom = np.clip(np.ceil(np.maximum(a, b) + radius) + 1, 0, size).astype(int)
    y, x = np.mgrid[top:bottom, left:right]
    along, length = b - a, float((b - a) @ (b - a))
    share = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / length, 0, 1) if length > 0 else 0.0
    near = np.hypot(x - a[0] - share * along[0], y - a[1] - share * along[1]) <= radius
    mask[top:bottom, left:right][near] = value


@dataclass(slots=True)
class History:
    """The steps in one image: what was, what is, and what an undone step can give back.

    Attributes
    ----------
    version : int
        Steps so far, undone ones and undoing included: what a page must have seen before it may change anything.
    size : int or None
        Bytes of the image's file at the last step: of another file they are others.
    """

    now: ImagePicks = field(default_factory=ImagePicks)
    past: list[ImagePicks] = field(default_factory=list)
    future: list[ImagePicks] = field(default_factory=list)
    version: int = 0
    accepted: bool = False
    size: int | None = None

    def after(self, do: str, picked: ImagePicks | None = None) -> ImagePicks | None:
        """What a step leads to: ``pick``, ``undo`` or ``redo``; None where there is nothing to be undone or redone."""
        steps = {"undo": self.past, "redo": self.future}.get(do, [picked])
        return steps[-1] if steps else None

    def step(self, do: str, picked: ImagePicks | None = None) -> bool:
        """Take a step; False where there is nothing to be undone or redone."""
        after = self.after(do, picked)
        if after is None:
            return False
        if do == "undo":
            self.past.pop()
            self.future.append(self.now)
        else:
            self.past.append(self.now)
            self.future = self.future[:-1] if do == "redo" else []
        self.now = after
        self.version += 1
        self.accepted |= self.now.status == "accepted"
        return True


class Journal:
    """The steps in all images, one line of JSON each, on the disk before they count.

    Parameters
    ----------
    path : str
        A line that a crash has cut off is dropped.

    Attributes
    ----------
    last : str
        The image of the last step that was read; empty where there is none.

    Raises
    ------
    OutputError
        If it cannot be read, or holds what is no step.
    """

    def __init__(self, path: str) -> None:
        self._path, self.last = path, ""
        self.tracks: dict[str, History] = {}
        try:
            self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | OWN | os.O_APPEND, 0o666)
            with os.fdopen(os.dup(self._descriptor), "rb") as file:
                lines = file.read().splitlines(keepends=True)
            if lines and not lines[-1].endswith(b"\n"):
                os.ftruncate(self._descriptor, sum(map(len, lines[:-1])))
                del lines[-1]
        except OSError as error:
            raise unwritten(path, error) from error
        for number, line in enumerate(lines, 1):
            self._replay(number, line)

    def _replay(self, number: int, line: bytes) -> None:
        try:
            entry = json.loads(line)
            picked = ImagePicks.read(entry["picked"]) if entry["do"] == "pick" else None
            track = self.track(entry["image"])
            track.step(entry["do"], picked)
            track.size = entry.get("size")
            self.last = entry["image"]
        except (ValueError, KeyError, TypeError, RecursionError, UsageError) as error:
            raise OutputError(
                f"{printable(self._path)}:{number} is no step of ffseg pick ({error}); restore it"
            ) from error

    def track(self, image: str) -> History:
        """The steps in an image."""
        return self.tracks.setdefault(image, History())

    def add(self, image: str, do: str, picked: ImagePicks | None = None, size: int | None = None) -> bool:
        """Take a step and keep it, with the bytes of the image's file; False where there is none to take.

        `take_back` gives back what was before the last one.

        Raises
        ------
        OutputError
            If it cannot be written, or lies at its place no more; the step is not taken then.
        """
        track = self.track(image)
        if track.after(do, picked) is None:
            return False
        self.require_in_place()
        entry = {"image": image, "do": do, "size": size} | ({} if picked is None else {"picked": asdict(picked)})
        line = json.dumps(entry, separators=(",", ":")).encode("ascii") + b"\n"
        before = os.fstat(self._descriptor)
        try:
            if os.write(self._descriptor, line) != len(line):
                raise OSError(28, "no space")
            os.fsync(self._descriptor)
        except OSError as error:
            os.ftruncate(self._descriptor, before.st_size)
            raise unwritten(self._path, error) from error
        self._before = before, image, replace(track, past=[*track.past], future=[*track.future])
        track.size = size
        return track.step(do, picked)

    def require_in_place(self) -> None:
        """Refuse to go on in a folder that was moved away: files beside the journal would be made anew at its old place.

        Raises
        ------
        OutputError
            If it was.
        """
        with suppress(OSError):
            if os.path.samestat(os.fstat(self._descriptor), os.stat(self._path)):
                return
        raise OutputError(
            f"{printable(self._path)} was moved, removed or replaced since ffseg pick began; "
            "put it back, or end ffseg pick and start it anew"
        )

    def take_back(self) -> None:
        """Take back the last step that was added: what follows from it cannot be written."""
        before, image, track = self._before
        os.ftruncate(self._descriptor, before.st_size)
        self.tracks[image] = track

    def names(self, wanted: Callable[[History], bool]) -> list[str]:
        """Images whose steps are so."""
        return [image for image, track in self.tracks.items() if wanted(track)]

    def close(self) -> None:
        """Let the file go."""
        os.close(self._descriptor)
