"""Contours as SVG text: exact Bezier paths over the image they belong to."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ffseg.arrays import Points
from ffseg.geometry import bezier
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.regions import group_regions
from ffseg.native import _core

CUBIC_TOLERANCE = 0.005
"""Pixels by which the cubics that stand for patches of degree 4 to 6 may leave them: unseen at a 100-fold zoom."""

DECIMALS = 4
"""Digits behind the point: a control point is off by at most 0.00005 px."""

_TINT = ' fill="#50dc3c" fill-opacity="0.25" stroke="#50dc3c"'
"""The look of overlays, over an image."""
_COMMANDS = {1: "L", 2: "Q", 3: "C"}
_MAX_NATIVE = 1e11
"""Pixels; beyond, ten-thousandths are no exact integers."""

_NOT_XML = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"
"""Characters XML 1.0 cannot hold even escaped: controls, and the surrogates that stand for bytes of no encoding. Not
compiled here: that takes 4 ms, and most documents have no title."""


def svg_document(contours: Sequence[FreeForm], width: int, height: int, title: str = "", behind: str = "") -> str:
    """SVG of the regions the contours enclose, one path each.

    Parameters
    ----------
    contours : sequence of FreeForm
        In pixels, integers at pixel centres; outer ones of positive area, holes negative.
    width, height : int
        Of the image, pixels; the user unit is one pixel, (0, 0) its outer corner.
    title : str
        Shown by viewers, escaped; left out when empty.
    behind : str
        Address of an image, relative to the document, to be shown behind the regions, which are then tinted instead
        of black.

    Returns
    -------
    str
        A whole document, to be stored as UTF-8. Degree 1, 2, 3 are L, Q, C commands on the contour's own control
        points; higher degrees are cubics within `CUBIC_TOLERANCE`. Coordinates are the contour's plus 0.5.
    """
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">',
    ]
    if title:
        lines.append(f"<title>{escape(title)}</title>")
    if behind:
        lines.append(f'<image href="{escape(behind)}" width="{width}" height="{height}"/>')
    for region in group_regions(contours):
        data = " ".join(path_data(contour) for contour in region.contours)
        lines.append(f'<path fill-rule="evenodd"{_TINT if behind else ""} d="{data}"/>')
    return "\n".join([*lines, "</svg>", ""])


def path_data(contour: FreeForm) -> str:
    """The ``d`` attribute of one closed contour, shifted by half a pixel."""
    if contour.degree <= 3:
        points, degree = contour.control_points, contour.degree
    else:
        cubics = np.concatenate([bezier.as_cubics(patch, CUBIC_TOLERANCE) for patch in contour.patches])
        points, degree = cubics[:, :3].reshape(-1, 2), 3
    shifted = points + 0.5
    if np.abs(shifted).max() <= _MAX_NATIVE:
        return _core.path_text(shifted, degree)
    return _path_text(shifted, degree)


def _path_text(points: Points, degree: int) -> str:
    """As the native `path_text`, number by number, for any size."""
    texts = [f"{number(x)},{number(y)}" for x, y in points.tolist()]
    ends = texts[1:] if degree == 1 else [*texts[1:], texts[0]]  # Z draws the last edge of a polygon
    commands = (_COMMANDS[degree] + " ".join(ends[i : i + degree]) for i in range(0, len(ends), degree))
    return " ".join([f"M{texts[0]}", *commands, "Z"])


def number(value: float) -> str:
    """The one way ffseg writes a coordinate: at most `DECIMALS` digits behind the point, no trailing zeros, no -0."""
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def escape(text: str) -> str:
    """Text fit to stand between XML tags or in a quoted attribute; what XML cannot hold becomes U+FFFD."""
    clean = re.sub(_NOT_XML, "\ufffd", text)
    for character, entity in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;"), ("'", "&#39;")):
        clean = clean.replace(character, entity)
    return clean
