"""OCamCalib's ``calib_results.txt``: five data lines between comments."""

from __future__ import annotations

import math

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.projections import Polynomial, polynomial_limit
from ffseg.schema.nodes import Problems

MAX_COEFFICIENTS = 64
"""The toolbox writes 5 forward and about 12 inverse ones."""
MAX_SIDE = 65_500
_LINES = ("ss (forward polynomial)", "invpol (inverse polynomial)", "center", "affine", "size")


def looks_like(text: str) -> bool:
    """True when the first comment is the one OCamCalib writes."""
    return text.lstrip().startswith("#polynomial coefficients")


def read(text: str, name: str, problems: Problems) -> Camera | None:
    """Read the camera, mounted nowhere; None with the problems noted.

    The inverse polynomial is an approximation of the forward one: it is checked for form and not used.
    """
    rows = _rows(text, name, problems)
    if problems.lines:
        return None
    if len(rows) != len(_LINES):
        problems.add(name, f"{len(rows)} lines of numbers, an OCamCalib file has 5: {', '.join(_LINES)}")
        return None
    forward, _, (centre_line, centre), (affine_line, affine), (size_line, size) = rows
    coefficients = _counted(forward, name, _LINES[0], problems)
    _counted(rows[1], name, _LINES[1], problems)
    _length(f"{name}:{centre_line}", _LINES[2], centre, 2, problems)
    _length(f"{name}:{affine_line}", _LINES[3], affine, 3, problems)
    _length(f"{name}:{size_line}", _LINES[4], size, 2, problems)
    if problems.lines:
        return None
    _plausible(rows, coefficients, name, problems)
    if problems.lines:
        return None
    return _camera(coefficients, (centre[1], centre[0]), affine, (int(size[1]), int(size[0])))


def _rows(text: str, name: str, problems: Problems) -> list[tuple[int, list[float]]]:
    rows: list[tuple[int, list[float]]] = []
    for number, line in enumerate(text.splitlines(), 1):
        content = line.partition("#")[0].split()
        if not content or problems.lines:
            continue
        try:
            values = [_number(word) for word in content[: MAX_COEFFICIENTS + 2]]
        except ValueError:
            problems.add(f"{name}:{number}", "not a line of numbers; an OCamCalib file holds numbers and # comments")
            continue
        if not all(math.isfinite(value) and abs(value) < 1e12 for value in values):
            problems.add(f"{name}:{number}", "a number is not finite or absurdly large")
        rows.append((number, values))
    return rows


def _number(word: str) -> float:
    """A float as C writes it: Python's own reading also takes ``1_000``."""
    if "_" in word:
        raise ValueError(word)
    return float(word)


def _counted(row: tuple[int, list[float]], name: str, key: str, problems: Problems) -> list[float]:
    number, values = row
    if len(values) < 2 or values[0] != len(values) - 1 or len(values) - 1 > MAX_COEFFICIENTS:
        problems.add(
            f"{name}:{number}", f"{key}: the line must be a count (up to {MAX_COEFFICIENTS}) and as many coefficients"
        )
    return values[1:]


def _length(where: str, key: str, values: list[float], count: int, problems: Problems) -> None:
    if len(values) != count:
        problems.add(where, f"{key}: {len(values)} numbers, must be {count}")


def _plausible(rows: list[tuple[int, list[float]]], coefficients: list[float], name: str, problems: Problems) -> None:
    c, d, e = rows[3][1]
    if coefficients[0] >= 0:
        problems.add(f"{name}:{rows[0][0]}", f"{_LINES[0]}: the first coefficient must be negative")
    if abs(c - d * e) < 1e-3:
        problems.add(f"{name}:{rows[3][0]}", f"{_LINES[3]}: c - d*e is zero, the image would collapse to a line")
    if not all(value.is_integer() and 1 <= value <= MAX_SIDE for value in rows[4][1]):
        problems.add(f"{name}:{rows[4][0]}", f"{_LINES[4]}: height and width must be integers from 1 to {MAX_SIDE}")


def _camera(
    coefficients: list[float], center: tuple[float, float], affine: list[float], size: tuple[int, int]
) -> Camera:
    c, d, e = affine
    forward = np.array(coefficients)
    forward.setflags(write=False)
    width, height = size
    corners = np.array([[x, y] for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)]) - center
    down = (corners[:, 1] - d * corners[:, 0]) / (c - d * e)
    right = (c * corners[:, 0] - e * corners[:, 1]) / (c - d * e)
    limit = polynomial_limit(forward, float(np.hypot(down, right).max()))
    return Camera(Polynomial(forward, center, (c, d, e), limit), width, height, center)
