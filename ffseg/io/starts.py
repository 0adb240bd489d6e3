"""Starts files: CSV with the starts of each image and whatever else was picked in it."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from ffseg.errors import ParameterError
from ffseg.io.files import printable
from ffseg.io.tables import csv_table, neutral
from ffseg.parameters import MAX_COORDINATE, Box, Parameters, Point, Seed
from ffseg.schema.nodes import Problems
from ffseg.schema.strict_csv import finite, read_table, rows_of

PICKED = ["image", "kind", "x", "y", "radius", "right", "bottom", "value"]
"""The header of files with other rows than starts; each kind of row fills the columns that `KINDS` names."""
HEADERS = (["image", "x", "y"], ["image", "x", "y", "radius"], PICKED)
KINDS = {
    "start": ("x", "y", "radius"),
    "not": ("x", "y", "radius", "value"),
    "box": ("x", "y", "right", "bottom"),
    "model": (),
    "alike": (),
    "probability": ("value",),
    "clearance": ("value",),
}
FLAGS = {"alike": "alike", "model": "found"}
"""Kinds of rows that are there or not, and the attribute of `Start` that each sets."""
LIMITS = {"probability": (0.01, 0.99), "clearance": (0.0, 1000.0)}
"""Values allowed, as of the parameters whose place they take."""
MAX_PIXELS = float(MAX_COORDINATE)
"""Positions and radii beyond this lie in no image that is read."""


@dataclass(frozen=True, slots=True)
class Start:
    """Start circle of one image, and what else was picked in it.

    Attributes
    ----------
    x, y : float or None
        Its centre, pixels; None where there is no circle, only what follows.
    radius : float or None
        Pixels; None leaves ``init.radius``.
    others : tuple of Start
        The circles of further rows, in their order; each without others.
    background : tuple of (x, y), (x, y, radius) or (x, y, radius, after)
        Points and circles outside the region, the last with the number of circles that were picked before it.
    boxes : tuple of (left, top, right, bottom)
        Each round an object: all outside is background.
    probability, clearance : float or None
        In place of ``region.probability`` and ``contour.clearance``. With a probability of its own, what tells one
        decides: ``edges.source`` is ``prior`` where it is ``auto`` and there is no box.
    alike : bool
        All things that look like what is picked are meant, whatever a model tells: ``region.islands`` is ``all`` and
        ``edges.source`` is ``alike``.
    found : bool
        The start that a model finds comes before the circles, which correct it; else they take its place.
    held : bool
        It was said of an earlier frame of a film, and the region found there tells where to start now.
    """

    x: float | None = None
    y: float | None = None
    radius: float | None = None
    others: tuple[Start, ...] = ()
    background: tuple[Seed, ...] = ()
    boxes: tuple[Box, ...] = ()
    probability: float | None = None
    clearance: float | None = None
    alike: bool = False
    found: bool = False
    held: bool = False

    @property
    def circles(self) -> tuple[Start, ...]:
        """The first circle, if there is one, and the others."""
        return self.others if self.x is None else (replace(self, others=()), *self.others)

    @property
    def fixed(self) -> frozenset[str]:
        """Keys of the parameters that are this image's own, whatever else they are."""
        values = {
            "region.probability": self.probability,
            "contour.clearance": self.clearance,
            "region.islands": self.alike or None,
        }
        return frozenset(key for key, value in values.items() if value is not None)

    def placed(self, params: Parameters, shape: tuple[int, ...]) -> Parameters:
        """The parameters with what was picked in this image of shape (H, W, ...)."""
        init, found = params.init, self.found and params.edges.model is not None and not self.alike
        click = init.click_radius_in(shape)
        circles = [
            (one.x, one.y, click if one.radius is None else one.radius)
            for one in self.circles
            if one.x is not None and one.y is not None
        ]
        if len(circles) == 1 and not (self.boxes or init.boxes or found):
            radius = init.radius if self.circles[0].radius is None else circles[0][2]
            init = replace(init, center=circles[0][:2], radius=radius, circles=())
        elif circles:
            center: Point | Literal["auto"] = "auto" if found else circles[0][:2]
            init = replace(init, center=center, radius=circles[0][2], circles=tuple(circles))
        init = replace(init, boxes=self.boxes or init.boxes, background=(*init.background, *self.background))
        contour, region, edges = params.contour, params.region, params.edges
        if self.clearance is not None:
            contour = replace(contour, clearance=self.clearance)
        if self.alike:
            region, edges = replace(region, islands="all"), replace(edges, source="alike", model=None)
        if self.probability is not None:
            region = replace(region, probability=self.probability)
            if edges.source == "auto" and edges.model is None and not init.boxes:
                edges = replace(edges, source="prior")
        return replace(params, init=init, contour=contour, region=region, edges=edges)

    def next_frame(self) -> Start:
        """What holds in the next frame of a film as well: no place outside, and no circle that corrects what a box holds."""
        known = replace(self, x=None, y=None, radius=None, others=()) if self.boxes else self
        return replace(known, background=(), held=True)

    def text(self) -> str:
        """All that it says: equal texts, equal starts."""
        circles = ";".join(f"{one.x!r},{one.y!r},{one.radius!r}" for one in self.circles)
        more = (self.background, self.boxes, self.probability, self.clearance)
        circles += ";model" * self.found + ";held" * self.held + ";alike" * self.alike
        return circles if more == ((), (), None, None) else f"{circles};{more!r}"

    def rows(self, image: str) -> list[list[str | float | None]]:
        """Rows of a file with the header `PICKED`, of an image of this name."""
        name, none = printable(image), None
        rows: list[list[str | float | None]] = [
            [name, "start", one.x, one.y, one.radius, none, none, none] for one in self.circles
        ]
        seeds = ([*seed, none, none][:4] for seed in self.background)
        rows += [[name, "not", x, y, radius, none, none, after] for x, y, radius, after in seeds]
        rows += [[name, "box", left, top, none, right, bottom, none] for left, top, right, bottom in self.boxes]
        values = (("probability", self.probability), ("clearance", self.clearance))
        rows += [[name, kind, none, none, none, none, none, value] for kind, value in values if value is not None]
        return rows + [[name, kind, *[none] * 6] for kind, flag in FLAGS.items() if getattr(self, flag)]


def starts_table(starts: Mapping[str, Start]) -> bytes:
    """A starts file, of the starts by the relative names of their images."""
    return csv_table(PICKED, (row for image, start in starts.items() for row in start.rows(image)))


def check_starts(params: Parameters, path: str | os.PathLike[str]) -> None:
    """Refuse parameters that say where the contour starts by other means than a starts file."""
    others = {"init.circles": params.init.circles, "init.boxes": params.init.boxes, "init.mask": params.init.mask}
    named = next((key for key, value in others.items() if value), None)
    if named:
        raise ParameterError(
            f"{printable(path)} gives each image its starts, but {named} is set too; leave out one of them"
        )


def finds_starts(params: Parameters) -> bool:
    """Whether images that a starts file does not name are started by a model."""
    return params.edges.model is not None and params.edges.model.endswith(".ffmodel")


def load_starts(path: str | os.PathLike[str], images: Iterable[str], *, partial: bool = False) -> Mapping[str, Start]:
    """Read the starts of images.

    Parameters
    ----------
    path : path
        CSV with the header ``image,x,y`` or ``image,x,y,radius``; rows in any order, rows of other images are ignored.
        ``image`` is the relative name with ``/``, with or without its suffix, as the tables of a run write it. An empty
        radius leaves ``init.radius``. Several rows of one image are several circles. With the header `PICKED` a row is
        of one of the `KINDS`: a start, a point that lies outside (its value, where it has one, is the number of starts that were
        picked before it), a box, or a value in place of a parameter.
    images : iterable of str
        Relative names of the images that need a start.
    partial : bool
        No image needs a row: a model finds their starts.

    Returns
    -------
    mapping of str to Start
        By relative name, for the images that have rows; the others start as the parameters say.

    Raises
    ------
    ParameterError
        One line for each thing wrong, with file and line; also where no image has a row, and for an image without one whose
        name is nearly that of a row of no image.
    """
    name, problems = os.fspath(path), Problems()
    rows = _rows(read_table(name, ParameterError), printable(name), problems)
    problems.raise_as(ParameterError)
    exact = dict.fromkeys(images)
    names = {image: _row_of(image, rows, exact, printable(name), problems) for image in exact}
    if not partial:
        _require_rows(names, rows, printable(name), problems)
    problems.raise_as(ParameterError)
    return {image: rows[key][1] for image, key in names.items() if key}


def numbered_starts(path: str | os.PathLike[str]) -> Mapping[int, Start]:
    """Read the starts of frames that have no names: by the number that their names in the file end with, from 0.

    Raises
    ------
    ParameterError
        One line for each thing wrong, with file and line; also for two names that end with one number.
    """
    name, problems = os.fspath(path), Problems()
    found: dict[int, Start] = {}
    for image, (line, start) in _rows(read_table(name, ParameterError), printable(name), problems).items():
        digits = _LAST_NUMBER.search(os.path.splitext(image)[0])
        number = int(digits[0]) if digits else -1
        if number < 0 or number in found:
            what = "is called so already" if digits else "has no number at its end"
            problems.add(f"{printable(name)}:{line}", f"{image[:60]!r} {what}; call frames 0, 1, 2, ...")
        found[number] = start
    problems.raise_as(ParameterError)
    return found


def _require_rows(names: Mapping[str, str], rows: Mapping[str, _Row], name: str, problems: Problems) -> None:
    """Refuse a file that names no image, and rows of no image that are nearly called like one without a row."""
    used = set(names.values())
    spare = {row: line for row, (line, _) in rows.items() if row not in used}
    for image in [image for image, key in names.items() if not key][:_MAX_COMPARED]:
        near = _nearest(image, spare)
        if near or used <= {""}:
            problems.add(name, f"no row for the image {printable(image)!r}{near}; add one, or leave the image out")


_LAST_NUMBER = re.compile(r"[0-9]{1,18}$")

_Row = tuple[int, Start]
"""Line of the first row, and start."""
_Rows = dict[tuple[Any, ...], float | None]
"""Kind and numbers of the rows of one image; those of `LIMITS` come once, with their value behind."""
_PLACES = {kind: [PICKED.index(key) for key in keys] for kind, keys in KINDS.items()}


def _rows(text: str, name: str, problems: Problems) -> dict[str, _Row]:
    lines: dict[str, int] = {}
    rows_by_image: dict[str, _Rows] = {}
    for line, cells in rows_of(text, name, HEADERS, problems):
        where, count = f"{name}:{line}", len(cells)
        if count < len(PICKED):
            cells[1:] = ["start", *cells[1:], *[""] * (len(PICKED) - count - 1)]
        image, kind = cells[:2]
        if not image:
            problems.add(where, "image: the name is empty; write the image's relative name")
        if kind not in KINDS:
            problems.add(where, f"kind: {kind[:40]!r} is none of {', '.join(KINDS)}")
            continue
        places = _PLACES[kind]
        if count == len(PICKED):
            stray = [key for at, key in enumerate(PICKED[2:], 2) if cells[at] and at not in places]
            if stray:
                problems.add(where, f"{stray[0]}: a row of the kind {kind} has none; leave it empty")
        numbers = [_number(cells[at], at, kind, where, problems) for at in places]
        key, value = ((kind,), numbers[0]) if kind in LIMITS else ((kind, *numbers), None)
        _check_value(kind, numbers, where, problems)
        if image not in rows_by_image:
            rows_by_image[image], lines[image] = {}, line
        elif key in rows_by_image[image]:
            what = "this start already" if kind == "start" else f"a row for this {kind} already"
            problems.add(where, f"{image[:60]!r} has {what}; keep one row of it")
        rows_by_image[image][key] = value
    return {image: (lines[image], _start(rows)) for image, rows in rows_by_image.items()}


_RADIUS, _VALUE = PICKED.index("radius"), PICKED.index("value")


def _check_value(kind: str, numbers: Sequence[float | None], where: str, problems: Problems) -> None:
    value = numbers[-1] if "value" in KINDS[kind] else None
    if value is None:
        return
    if kind == "not" and (numbers[-2] is None or value < 0):
        problems.add(where, "value: the number of starts before this row is 0 or more, and needs a radius beside it")
    elif kind in LIMITS and not LIMITS[kind][0] <= value <= LIMITS[kind][1]:
        problems.add(where, f"value: a {kind} is from {LIMITS[kind][0]:g} to {LIMITS[kind][1]:g}, not {value:g}")


def _number(word: str, at: int, kind: str, where: str, problems: Problems) -> float | None:
    if not word and (at == _RADIUS or (at == _VALUE and kind == "not")):
        return None
    value = finite(word, MAX_PIXELS)
    if math.isnan(value):
        unit = "number" if at == _VALUE else "number of pixels"
        problems.add(where, f"{PICKED[at]}: {word[:40]!r} is not a finite {unit} up to {MAX_PIXELS:g}")
    if at == _RADIUS and value <= 0:
        problems.add(where, f"radius: {value:g} is not above 0; leave it empty for init.radius")
    return value


def _start(rows: _Rows) -> Start:
    """What all rows of one image say together."""
    circles: list[Start] = []
    more: dict[str, Any] = {}
    for (kind, *numbers), value in rows.items():
        if kind == "start":
            circles.append(Start(*numbers))
        elif kind in LIMITS:
            more[kind] = value
        elif kind in FLAGS:
            more[FLAGS[kind]] = True
        else:
            row = tuple(number for number in numbers if number is not None)
            more.setdefault("background" if kind == "not" else "boxes", []).append(row)
    named: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in more.items()}
    first, *others = circles or [Start()]
    return replace(first, others=tuple(others), **named) if others or named else first


def _row_of(image: str, rows: Mapping[str, _Row], exact: Collection[str], name: str, problems: Problems) -> str:
    """What the file calls an image, empty where it has no row; a problem when it has some under each of two names.

    The exact names of other images are theirs, as ``b.png`` beside ``b.png.jpg``.
    """
    keys = [key for key in _cells_of(image) if key in rows and (key == image or key not in exact)]
    if len(keys) > 1:
        first, second = keys[:2]
        lines = f"lines {rows[first][0]} ({first[:60]!r}) and {rows[second][0]} ({second[:60]!r})"
        problems.add(name, f"{lines} both name the image {printable(image)!r}; write the same name in both")
    return keys[0] if keys else ""


def _cells_of(image: str) -> Iterable[str]:
    """What a file may call an image: its name or that without the suffix, as it is or as a table shows it; cells are stripped."""
    plain = (image, os.path.splitext(image)[0])
    if image[:1].isalnum() and printable(image) == image:
        return dict.fromkeys(plain)  # which tables show as they are
    shown = [printable(one) for one in plain]
    return dict.fromkeys(cell.strip() for cell in (*plain, *shown, *map(neutral, shown)))


def _nearest(image: str, lines: Mapping[str, int]) -> str:
    from difflib import get_close_matches  # 5 ms that only a wrong name should cost

    near = get_close_matches(image, lines, n=1)
    return f" (line {lines[near[0]]} has {near[0][:60]!r})" if near else ""


_MAX_COMPARED = 3
"""Images looked up for a similar name: looking takes long in a long file, and the first ones show the reason."""
