"""Results of tuning: a parameter file with the measured figures, and a page with the regions before and after."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from statistics import mean, pstdev
from typing import TypeGuard

import numpy as np

from ffseg import __version__
from ffseg.arrays import Mask
from ffseg.io.files import printable
from ffseg.io.masks import encode_png
from ffseg.io.tables import counted
from ffseg.learning.gather import LabelledImage, few_known
from ffseg.learning.tune import TuningResult
from ffseg.metrics import IGNORED, INSIDE
from ffseg.parameter_text import non_defaults, yaml_lines, yaml_value
from ffseg.parameters import Parameters

MAX_SHOWN = 60
"""Images on the page."""

MAX_WIDTH = 360
"""px; pictures on the page are no wider."""


def summary_lines(tuned: TuningResult) -> list[str]:
    """The summary, line by line."""
    count = len(tuned.before)
    lines = [
        f"{counted(tuned.tried, 'setting')} tried on {counted(count, 'image')} in {tuned.seconds:.0f} s",
        f"IoU with the parameters as they were: {mean(tuned.before):.3f} (spread {pstdev(tuned.before):.3f})",
    ]
    lines += few_known(tuned.known)
    if count > 1:
        lines.append(
            f"of each image with what is best on the others: {mean(tuned.left_out):.3f} "
            f"(spread {pstdev(tuned.left_out):.3f})"
        )
    if tuned.setting:
        lines.append(f"with the setting below, on all of them: {mean(tuned.after):.3f}")
        if count > 1 and mean(tuned.left_out) < mean(tuned.before):
            lines.append(
                "what is best on some does worse on the others than the parameters did: draw more masks before it is used"
            )
    elif count > 1:
        lines.append("no setting beats them beyond the noise: they are kept")
    else:
        lines.append("what suits one image may be chance: they are kept; draw a second mask")
    spans = ", ".join(f"{key} {span:.3f}" for key, span in tuned.sensitivity)
    if spans:
        lines.append(f"how much hangs on each key (best less worst mean): {spans}")
    return lines


def not_tried(tuned: TuningResult) -> list[str]:
    """Settings for which there was no time."""
    if not tuned.left:
        return []
    count = tuned.tried + tuned.left
    return [f"not tried for want of time: {tuned.left} of {count} settings; a longer --budget tries them"]


def to_yaml(tuned: TuningResult, params: Parameters | None = None) -> str:
    """A parameter file of the tuned keys, with the figures as comments.

    Parameters
    ----------
    params : Parameters, optional
        What tuning began with: where it differs from the defaults it stands in the file as well, which is then all that a
        run needs.
    """
    lines = [f"# ffseg tune {__version__}", *(f"# {line}" for line in (*summary_lines(tuned), *not_tried(tuned)))]
    values = (non_defaults(params) if params is not None else {}) | tuned.setting
    return "\n".join([*lines, *yaml_lines(values, _text), ""])


def _text(value: object) -> str:
    return f"[{', '.join(map(_short, value))}]" if _is_row(value) else yaml_value(value)


def _short(number: float) -> str:
    """The shortest text that is read back as the same number."""
    return f"{number:g}" if float(f"{number:g}") == number else repr(number)


def _is_row(value: object) -> TypeGuard[tuple[float, ...]]:
    return isinstance(value, tuple) and all(isinstance(one, float | int) for one in value)


def to_html(
    tuned: TuningResult, labelled: Sequence[LabelledImage], masks: Sequence[tuple[Mask, Mask]], written: str
) -> str:
    """A self-contained page: figures, the parameter file written, and each image before and after."""
    sentences = [*summary_lines(tuned), *not_tried(tuned)]
    if tuned.best != tuned.setting:
        best = ", ".join(f"{key} {_text(value)}" for key, value in tuned.best.items())
        sentences.append(f"after: with the setting of the highest mean, which is not taken: {best}")
    lines = "".join(f"<p>{html.escape(line)}</p>" for line in sentences)
    rows = []
    for one, pair, before, after in list(zip(labelled, masks, tuned.before, tuned.after, strict=True))[:MAX_SHOWN]:
        name = html.escape(printable(one.name))
        pictures = "".join(f'<img alt="{name}" src="{_picture(one, mask)}">' for mask in pair)
        rows.append(f"<section><h2>{name}</h2><p>IoU {before:.3f} before, {after:.3f} after</p>{pictures}</section>")
    return _PAGE.format(setting=html.escape(written), lines=lines, rows="\n".join(rows))


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>ffseg tune</title>
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem }}
img {{ max-width: 48%; margin-right: 1% }} pre {{ background: #8882; padding: 1rem; overflow: auto }}
</style></head><body>
<h1>Before and after tuning</h1>
{lines}
<pre>{setting}</pre>
<p>Green: in the mask and found. Blue: missed. Orange: found outside the mask.</p>
{rows}
</body></html>
"""

_FOUND, _MISSED, _LEAKED = (90, 200, 60), (220, 120, 40), (30, 140, 255)
"""BGR."""


def _picture(one: LabelledImage, mask: Mask) -> str:
    """The image with true positives, missed and leaked pixels, as a data address."""
    step = max(1, -(-one.image.shape[1] // MAX_WIDTH))
    image, truth, found = one.image[::step, ::step], one.truth[::step, ::step], mask[::step, ::step]
    colour = np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image.copy()
    inside, counted = truth == INSIDE, truth != IGNORED
    for region, paint in ((found & inside, _FOUND), (inside & ~found, _MISSED), (found & ~inside & counted, _LEAKED)):
        colour[region] = (colour[region] // 2 + np.array(paint) // 2).astype(np.uint8)
    return "data:image/png;base64," + base64.b64encode(encode_png(np.ascontiguousarray(colour), [])).decode("ascii")
