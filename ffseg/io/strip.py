"""The evolution of a contour as a strip of vector pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ffseg.arrays import Image
from ffseg.io.overlays import jpeg_address
from ffseg.io.snapshots import Snapshot, evenly_spaced, scaled_down
from ffseg.io.svg import escape, number, path_data

PANELS = 6
_WIDTH = 400
"""px of the picture that stands under all panels; the contours over it are exact."""
_QUALITY = 80
_GAP, _CAPTION = 12, 34
_COLOURS = {True: "#3cdc50", False: "#f03c3c"}
"""Outer contours and holes, as the overlays have them."""


def film_strip_svg(image: Image, snapshots: Sequence[Snapshot], panels: int = PANELS, title: str = "") -> str:
    """SVG with panels side by side: the image with the contours of a snapshot, and the iteration below.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
        Grey or BGR; it stands once in the file, scaled down.
    snapshots : sequence of Snapshot
        Of these, `panels` are chosen evenly, the first and the last among them.
    title : str
        Shown by viewers, escaped; left out when empty.

    Returns
    -------
    str
        A whole document, to be stored as UTF-8. Contours are exact (`ffseg.io.svg`).
    """
    if not snapshots:
        raise ValueError("a film strip needs at least one snapshot")
    height, width = image.shape[:2]
    chosen = evenly_spaced(snapshots, panels)
    scale = _WIDTH / width
    panel_height = height * scale
    total = len(chosen) * (_WIDTH + _GAP) - _GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {total} {number(panel_height + _CAPTION)}" '
        f'width="{total}" height="{number(panel_height + _CAPTION)}" font-family="sans-serif" font-size="20">',
        *([f"<title>{escape(title)}</title>"] if title else []),
        f'<defs><image id="picture" width="{width}" height="{height}" preserveAspectRatio="none" '
        f'href="{jpeg_address(scaled_down(image, _WIDTH)[0], _QUALITY)}"/></defs>',
    ]
    for index, snapshot in enumerate(chosen):
        lines += [
            f'<g transform="translate({index * (_WIDTH + _GAP)} 0)"><g transform="scale({scale:.6g})">'
            '<use href="#picture"/>',
            *_paths(snapshot, 2 / scale),
            f'</g><text x="{_WIDTH / 2:g}" y="{number(panel_height + 24)}" text-anchor="middle" fill="#808890">'
            f"iteration {snapshot.iteration}</text></g>",
        ]
    return "\n".join([*lines, "</svg>", ""])


def _paths(snapshot: Snapshot, stroke: float) -> Iterator[str]:
    for contour in snapshot.contours:
        colour = _COLOURS[contour.signed_area > 0]
        yield f'<path d="{path_data(contour)}" fill="none" stroke="{colour}" stroke-width="{number(stroke)}"/>'
