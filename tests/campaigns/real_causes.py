"""Where the lost area of a segmentation went: a guess at the cause of each piece, and a picture to look at.

A leaked piece is judged by the edge along the true border it crossed, a missed one by what lies on either side of the
line where the contour stopped. The names are guesses to count with; the overlays show what it was.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.image.edges import EdgeMap, edge_map
from ffseg.io.masks import encode_png
from ffseg.metrics import IGNORED, INSIDE
from ffseg.parameters import Edges
from tests.campaigns.real_images import Outcome

SMALL = 0.02
"""Pieces below this part of the lost area are not judged."""
NEAR, FAR = 6, 20
"""Pixels from the line where the contour stopped: what lies right behind it, and what lies well behind."""
FAINT = 1.5
"""Grey levels per pixel below which a border cannot be told from rounding."""
OPENING = 12
"""Pixels of weak border up to which a leak went through a gap in a good edge."""
TEXTURED = 0.06
"""Share of edge pixels in a missed piece from which it is texture."""
ALIKE = 12.0
"""Distance of Lab colours (8 bit) below which two sides are the same ground."""
BRIGHT, DARK = 14.0, -14.0
"""Difference in lightness from which what stopped the contour is a highlight or a shadow, colour being alike."""

Mask = NDArray[np.bool_]


def causes(outcome: Outcome) -> dict[str, float]:
    """Parts of the lost area by guessed cause; they sum to 1, or there is none when nothing is lost."""
    if outcome.result is None:
        return {"failed": 1.0}
    seen = _Scene(outcome)
    total = int(np.count_nonzero(outcome.missed) + np.count_nonzero(outcome.leaked))
    found: dict[str, float] = {}
    for lost, judge in ((outcome.missed, seen.stopped_by), (outcome.leaked, seen.leaked_through)):
        for piece, area in _pieces(lost):
            cause = judge(piece) if area >= SMALL * total else "small pieces"
            found[cause] = found.get(cause, 0.0) + area / total
    return found


def named(outcome: Outcome) -> Outcome:
    """The outcome with the cause of the largest part of what it lost."""
    found = causes(outcome)
    return replace(outcome, cause=max(found, key=lambda cause: found[cause]) if found else "")


def _pieces(region: Mask) -> list[tuple[Mask, int]]:
    count, labels, stats, _ = cv2.connectedComponentsWithStats(region.astype(np.uint8), connectivity=8)
    order = sorted(range(1, count), key=lambda label: -int(stats[label, cv2.CC_STAT_AREA]))
    large = [(labels == label, int(stats[label, cv2.CC_STAT_AREA])) for label in order[:12]]
    rest = int(sum(stats[label, cv2.CC_STAT_AREA] for label in order[12:]))
    return large + ([(np.zeros(region.shape, bool), rest)] if rest else [])


class _Scene:
    """Edges and colours of an image beside its result."""

    def __init__(self, outcome: Outcome) -> None:
        self.outcome = outcome
        image = outcome.photograph.image
        self.edges: EdgeMap = edge_map(image, Edges())
        colour = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
        self.lab = cv2.GaussianBlur(cv2.cvtColor(colour, cv2.COLOR_BGR2LAB).astype(np.float32), (0, 0), 1.5)
        self.ridge = cv2.dilate(self.edges.magnitude().astype(np.float32), np.ones((7, 7), np.uint8))

    def leaked_through(self, piece: Mask) -> str:
        """What let a leaked piece happen."""
        truth = self.outcome.photograph.truth
        border = _grown(piece, NEAR) & _grown(truth == INSIDE, NEAR) & ~piece
        if truth[border].size and np.mean(truth[border] == IGNORED) > 0.5:
            border = _grown(truth == INSIDE, 2) & _grown(piece, 3 * NEAR) & (truth != INSIDE)
        if not border.any():
            return "leak: no border"
        strength = self.ridge[border]
        low = self.edges.thresholds[0]
        weak = strength < low
        if np.count_nonzero(weak) <= OPENING * NEAR:
            return "leak: gap"
        return "leak: faint border" if np.percentile(strength[weak], 75) < FAINT else "leak: below threshold"

    def stopped_by(self, piece: Mask) -> str:
        """What kept the contour out of a missed piece."""
        before = _grown(piece, NEAR) & self.outcome.mask
        if not before.any():
            return "missed: not reached"
        behind = piece & _grown(before, NEAR)
        far = piece & _grown(before, FAR) & ~_grown(before, FAR - NEAR)
        if np.mean(self.edges.edges[piece] > 0) > TEXTURED:
            return "missed: texture"
        if not (self.edges.edges[_grown(behind, 2)] > 0).any():
            return "missed: narrow"
        step = self._step(before, behind if not far.any() else far)
        chroma = float(np.hypot(step[1], step[2]))
        if np.hypot(step[0], chroma) < ALIKE:
            return "missed: paint or seam"
        if chroma < ALIKE / 2 and step[0] > BRIGHT:
            return "missed: highlight"
        return "missed: shadow" if chroma < ALIKE / 2 and step[0] < DARK else "missed: another part"

    def _step(self, before: Mask, behind: Mask) -> NDArray[np.float64]:
        return np.asarray(np.median(self.lab[behind], axis=0) - np.median(self.lab[before], axis=0), np.float64)


def _grown(region: Mask, pixels: int) -> Mask:
    size = 2 * pixels + 1
    grown: Mask = cv2.dilate(region.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))) > 0
    return grown


def overlay(outcome: Outcome) -> bytes:
    """PNG file: truth green, result red, missed blue, leaked orange, ignored darker, the start circle white."""
    one = outcome.photograph
    canvas = one.image.copy() if one.image.ndim == 3 else np.repeat(one.image[..., None], 3, axis=2)
    canvas[one.truth == IGNORED] //= 2
    for region, colour in ((outcome.missed, (255, 90, 30)), (outcome.leaked, (20, 140, 255))):
        canvas[region] = (0.6 * canvas[region] + 0.4 * np.array(colour)).astype(np.uint8)
    for region, colour in ((one.truth == INSIDE, (0, 230, 0)), (outcome.mask, (0, 0, 255))):
        lines, _ = cv2.findContours(region.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(canvas, lines, -1, colour, 1)
    x, y, radius = (round(value) for value in one.circle)
    cv2.circle(canvas, (x, y), radius, (255, 255, 255), 1, cv2.LINE_AA)
    caption = np.zeros((34, canvas.shape[1], 3), np.uint8)
    for line, text in enumerate((f"{one.name} IoU {outcome.overlap:.3f}", outcome.cause or outcome.message)):
        cv2.putText(caption, text, (4, 13 + 15 * line), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return encode_png(np.vstack([caption, canvas]), [cv2.IMWRITE_PNG_COMPRESSION, 3])
