"""Contours read back from the SVG files of a run, and packed for drawing in the report page."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice

import numpy as np

from ffseg.arrays import Array
from ffseg.geometry import bezier
from ffseg.geometry.freeform import FreeForm

UNITS = 100
"""Units of the packed paths in a pixel: a hundredth shows at no zoom the page offers."""

_DATA = re.compile(r"\sd=\"([^\"]*)\"")
_SUBPATH = re.compile(r"M([^M]*?)Z")
_TO_SPACES = str.maketrans("LQC,\n", "     ")
_DEGREES = {"L": 1, "Q": 2, "C": 3}
_PLAIN = re.compile(r"[-+MLQCZe\d., \n]*")
_CHORDS = 4
"""Chords to a patch for centroids: patches are short, and a tenth of a pixel is what the page shows. Areas are exact."""

MAX_COORDINATE = 1e7
"""Pixels: beyond the sides of any image by a hundred times."""


def read_contours(text: str, most: int = 1 << 30) -> tuple[FreeForm, ...]:
    """Contours of an SVG file written by `ffseg.io.svg`.

    Parameters
    ----------
    text : str
        The whole file.
    most : int
        Contours.

    Returns
    -------
    tuple of FreeForm
        In pixels, integers at pixel centres, in the order of the file.

    Raises
    ------
    ValueError
        If a path holds anything but closed chains of L, Q or C with absolute numbers, or there are more contours.
    """
    contours: list[FreeForm] = []
    for tag in text.split("<path")[1:]:  # each is looked through once, whatever they are
        data = _DATA.search(tag.partition(">")[0])
        if data is None:
            continue
        if not _PLAIN.fullmatch(data[1]):
            raise ValueError("a path holds other commands than M, L, Q, C and Z")
        if len(contours) + data[1].count("M") > most:
            raise ValueError(f"there are more than {most} contours")
        contours += [_contour(piece) for piece in _SUBPATH.findall(data[1])]
    return tuple(contours)


def _contour(data: str) -> FreeForm:
    """One closed chain, from behind its M to before its Z."""
    letters = set(_DEGREES) & set(data)
    if len(letters) != 1:
        raise ValueError("a contour mixes patches of several degrees, or has none")
    degree = _DEGREES[letters.pop()]
    numbers = np.array([float(word) for word in data.translate(_TO_SPACES).split()])
    if len(numbers) % 2:
        raise ValueError("a contour has an x without a y")
    if not (np.abs(numbers) <= MAX_COORDINATE).all():
        raise ValueError("a contour lies farther away than any image reaches")
    points = numbers.reshape(-1, 2) - 0.5
    if degree > 1:
        points = points[:-1]  # the last patch ends where the first begins; of degree 1, Z is the last patch
    return FreeForm(np.ascontiguousarray(points), degree)


def packed_path(contour: FreeForm) -> str:
    """SVG path in `UNITS` to the pixel, corner at 0, relative to the pen: whole numbers, no drift."""
    grid = np.rint((contour.patches + 0.5) * UNITS).astype(np.int64)
    relative = (grid[:, 1:] - grid[:, :1]).reshape(-1)
    start = grid[0, 0]
    return f"M{start[0]} {start[1]}{'lqc'[contour.degree - 1]}{' '.join(map(str, relative.tolist()))}z"


def centroid(contour: FreeForm) -> tuple[float, float]:
    """Centre of the enclosed area; of the points where no area is enclosed."""
    points = bezier.evaluate(contour.patches[:, None], np.arange(_CHORDS) / _CHORDS).reshape(-1, 2)
    origin = points[0]
    x, y = (points - origin).T
    following_x, following_y = np.roll(x, -1), np.roll(y, -1)
    cross = x * following_y - following_x * y
    area = cross.sum() / 2
    if abs(area) < 1e-9:
        middle = points.mean(axis=0)
        return float(middle[0]), float(middle[1])
    moments = np.array([((x + following_x) * cross).sum(), ((y + following_y) * cross).sum()]) / (6 * area)
    return float(origin[0] + moments[0]), float(origin[1] + moments[1])


def packed_components(contours: Sequence[FreeForm], verdicts: Iterable[Mapping[str, object]] = ()) -> str:
    """Contours and what is known about them, small enough to stand in a page a thousand times.

    Parameters
    ----------
    contours : sequence of FreeForm
        Of degree 1 to 3.
    verdicts : iterable of mappings
        Rows of ``obstacles.csv`` of the same image, with numbers as numbers.

    Returns
    -------
    str
        Base64 of raw deflate of a JSON list; each item has ``area`` and ``at``, ``d`` unless the component was merged
        into the free space, and ``verdict``, ``points``, ``altitude`` where there is a row for it.
    """
    parts: list[dict[str, object]] = []
    for contour in contours:
        x, y = centroid(contour)
        area = round(contour.signed_area, 1)
        parts.append({"d": packed_path(contour), "area": area, "at": [round(x, 1), round(y, 1)]})
    for row in islice(verdicts, MAX_VERDICTS):
        _attach(parts, row)
    return pack(parts)


MAX_VERDICTS = 500
"""Rows of one image that are shown: pairs have a few dozen components."""


def pack(value: object) -> str:
    """Base64 of the raw deflate stream of a JSON value."""
    deflate = zlib.compressobj(6, zlib.DEFLATED, -15)
    data = deflate.compress(json.dumps(value, separators=(",", ":")).encode("ascii")) + deflate.flush()
    return base64.b64encode(data).decode("ascii")


_MAX_CENTROID_DISTANCE = 3.0
"""px between the centroid of the pixels of a component and that of its curve; more means another component."""


def _attach(parts: list[dict[str, object]], row: Mapping[str, object]) -> None:
    """Give a verdict to the hole it is about, or stand on its own where the hole is no more."""
    at = _numbers(row, "centroid_x", "centroid_y")
    facts = {"verdict": row.get("verdict"), "points": row.get("matched_points"), "altitude": row.get("max_altitude_m")}
    holes = [part for part in parts if "d" in part and "verdict" not in part and _area(part) < 0]
    distances = np.hypot(*(np.array([part["at"] for part in holes]).reshape(-1, 2) - at).T)
    if holes and distances.min() <= _MAX_CENTROID_DISTANCE:
        holes[int(np.argmin(distances))].update(facts)
        return
    parts.append({"area": -float(_numbers(row, "area_px")[0]), "at": at.tolist(), **facts})


def _area(part: Mapping[str, object]) -> float:
    area = part["area"]
    return area if isinstance(area, float) else 0.0


def _numbers(row: Mapping[str, object], *names: str) -> Array:
    values = [row.get(name) for name in names]
    return np.array([value if isinstance(value, (int, float)) else 0.0 for value in values], dtype=np.float64)
