"""Starts files: CSV ``image,x,y`` or ``image,x,y,radius``, the start circle or circles of each image."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from ffseg.errors import ParameterError
from ffseg.io.files import printable
from ffseg.parameters import FARTHEST, Parameters
from ffseg.schema.nodes import Problems
from ffseg.schema.strict_csv import finite, rows_of
from ffseg.schema.strict_yaml import read_text

HEADERS = (["image", "x", "y"], ["image", "x", "y", "radius"])
MAX_PIXELS = float(FARTHEST)
"""Positions and radii beyond this lie in no image that is read."""


@dataclass(frozen=True, slots=True)
class Start:
    """Start circle of one image, and others if it has several.

    Attributes
    ----------
    x, y : float
        Its centre, pixels.
    radius : float or None
        Pixels; None leaves ``init.radius``.
    others : tuple of Start
        The circles of further rows, in their order; each without others.
    """

    x: float
    y: float
    radius: float | None = None
    others: tuple[Start, ...] = ()

    def placed(self, params: Parameters) -> Parameters:
        """The parameters with this circle, or all the circles, as their start."""
        radius = params.init.radius if self.radius is None else self.radius
        circles = tuple(
            (one.x, one.y, params.init.radius if one.radius is None else one.radius) for one in (self, *self.others)
        )
        init = replace(params.init, center=(self.x, self.y), radius=radius, circles=circles if self.others else ())
        return replace(params, init=init)

    def text(self) -> str:
        """All that it says: equal texts, equal starts."""
        return ";".join(f"{one.x!r},{one.y!r},{one.radius!r}" for one in (self, *self.others))


def check_starts(params: Parameters, path: str | os.PathLike[str]) -> None:
    """Refuse parameters that say where the contour starts by other means than a starts file.

    Raises
    ------
    ParameterError
        Naming the file and the key.
    """
    others = {"init.circles": params.init.circles, "init.boxes": params.init.boxes, "init.mask": params.init.mask}
    given = next((key for key, value in others.items() if value), None)
    if given:
        raise ParameterError(
            f"{printable(path)} gives each image its start circle, but {given} is set too; leave out one of them"
        )


def load_starts(path: str | os.PathLike[str], images: Iterable[str]) -> Mapping[str, Start]:
    """Read the start circles of images.

    Parameters
    ----------
    path : path
        CSV with the header ``image,x,y`` or ``image,x,y,radius``; rows in any order, rows of other images are ignored.
        ``image`` is the relative name with ``/``, with or without its suffix, as the tables of a run write it. An empty
        radius leaves ``init.radius``. Several rows of one image are several circles.
    images : iterable of str
        Relative names of the images that need a start.

    Returns
    -------
    mapping of str to Start
        By relative name, for every image.

    Raises
    ------
    ParameterError
        One line for each thing wrong, with file and line; also for every image without a row.
    """
    name, problems = os.fspath(path), Problems()
    text = read_text(name, problems)
    problems.raise_as(ParameterError)
    rows = _rows(text, printable(name), problems)
    problems.raise_as(ParameterError)
    found = {image: _row_of(image, rows, printable(name), problems) for image in images}
    problems.raise_as(ParameterError)
    return {image: start for image, (_, start) in found.items()}


_Row = tuple[int, Start]
"""Line of the first circle, and start."""


def _rows(text: str, name: str, problems: Problems) -> dict[str, _Row]:
    rows: dict[str, _Row] = {}
    for line, (image, *words) in rows_of(text, name, HEADERS, problems):
        where = f"{name}:{line}"
        x, y = (_pixels(word, key, where, problems) for word, key in zip(words[:2], "xy", strict=True))
        radius = _pixels(words[2], "radius", where, problems) if len(words) > 2 and words[2] else None
        if radius is not None and radius <= 0:
            problems.add(where, f"radius: {radius:g} is not above 0; leave it empty for init.radius")
        if not image:
            problems.add(where, "image: the name is empty; write the image's relative name")
        at, first = rows.get(image, (line, None))
        one = Start(x, y, radius)
        if first is not None and one in (replace(first, others=()), *first.others):
            problems.add(where, f"{image[:60]!r} has this start already; keep one row of it")
        rows[image] = at, one if first is None else replace(first, others=(*first.others, one))
    return rows


def _pixels(word: str, key: str, where: str, problems: Problems) -> float:
    value = finite(word, MAX_PIXELS)
    if math.isnan(value):
        problems.add(where, f"{key}: {word[:40]!r} is not a finite number of pixels up to {MAX_PIXELS:g}")
    return value


def _row_of(image: str, rows: Mapping[str, _Row], name: str, problems: Problems) -> _Row:
    """Row of an image; a problem when it has none, or one under each of two names."""
    names = dict.fromkeys((image, os.path.splitext(image)[0], printable(image), printable(os.path.splitext(image)[0])))
    given = [key for key in names if key in rows]
    if len(given) > 1:
        first, second = given[:2]
        lines = f"lines {rows[first][0]} ({first[:60]!r}) and {rows[second][0]} ({second[:60]!r})"
        problems.add(name, f"{lines} both name the image {printable(image)!r}; write the same name in both")
    elif not given:
        hint = _nearest(image, rows) if len(problems.lines) < _MOST_COMPARED else ""
        problems.add(name, f"no row for the image {printable(image)!r}{hint}; add one, or leave the image out")
    return rows[given[0]] if given else (0, Start(math.nan, math.nan))


def _nearest(image: str, rows: Mapping[str, _Row]) -> str:
    from difflib import get_close_matches  # 5 ms that only a wrong name should cost

    near = get_close_matches(image, rows, n=1)
    return f" (line {rows[near[0]][0]} has {near[0][:60]!r})" if near else ""


_MOST_COMPARED = 3
"""Images looked up for a similar name: looking takes long in a long file, and the first ones show the reason."""
