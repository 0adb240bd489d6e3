"""The parameters at hand on four sets of real images with truth: overlap, where the lost area went, and how sure it was.

Run ``python -m tests.campaigns.real_sets --data DATA --out DIR [--config FILE] [--set KEY=VALUE]... [--sets a,b]``.
DATA (or the environment variable FFSEG_DATA) holds the folders of `SETS`, each with ``images/``, ``truth/`` (255 inside,
128 ignored) and ``seeds.csv``; folders that are absent are named and left out. An image that fails counts as IoU 0.

Writes ``images.csv`` (one row an image), ``sets.csv`` and overlays of the worst images (truth green, result red, missed
blue, leaked orange). ``--before images.csv`` compares with an earlier table. ``--invariance real`` or ``drawn`` checks
that turning, shifting, dimming and moving the start change nothing.
Images sorted by name: those at even places are one half, those at odd places the other.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from statistics import mean, median
from typing import Annotated

import cv2
import numpy as np
import typer
from numpy.typing import NDArray

from ffseg.io.files import write_bytes_atomic
from ffseg.io.images import single_thread
from ffseg.io.masks import encode_png
from ffseg.io.tables import csv_table
from ffseg.metrics import IGNORED, INSIDE
from ffseg.parameters import load_params
from tests.campaigns import harness, real_invariance
from tests.campaigns.real_images import COLUMNS, SETS, Outcome, evaluate, load, score
from tests.real_data import data_folder

GOALS = {"road": 0.60, "seeded_objects": 0.55, "real_floors/indoor": 0.82, "real_floors/omni": 0.70}
"""Mean IoU wanted from one default, by set."""
POOR = 0.6
"""IoU below which an image ranked worst by its score was ranked rightly."""


def main(  # noqa: PLR0913 - options of a command
    out: Annotated[Path, typer.Option()], data: Path = data_folder(), sets: str = ",".join(SETS), config: str | None = None,
    settings: Annotated[list[str] | None, typer.Option("--set")] = None, overlays: int = 10, repeat: int = 1,
    before: Path | None = None, invariance: str = "", scenes: int = 50,
) -> int:  # fmt: skip
    """Run the campaign; 0 also when the images are absent."""
    (out / "worst").mkdir(exist_ok=True, parents=True)
    folders = sets.split(",")
    for folder in folders:
        if not (data / folder / "seeds.csv").is_file():
            print(f"left out: {folder} has no seeds.csv in {data}")
    photographs = list(load(data, folders))
    if not photographs:
        print(f"skipped: none of the sets is in {data}; name the folder with --data or FFSEG_DATA")
        return 0
    single_thread()
    params = load_params(config, settings or [])
    outcomes = [evaluate(one, params, repeat) for one in photographs]
    write_bytes_atomic(out / "images.csv", csv_table(COLUMNS, [one.cells() for one in outcomes]))
    table = summary(outcomes)
    write_bytes_atomic(out / "sets.csv", csv_table(table[0], table[1:]))
    print(aligned(table))
    print(about_scores(outcomes))
    if before:
        print(changes(outcomes, before))
    for rank, one in enumerate(worst(outcomes, overlays)):
        name = f"{rank:02d}-{one.photograph.folder.replace('/', '-')}-{Path(one.photograph.name).stem}.png"
        write_bytes_atomic(out / "worst" / name, overlay(one))
    if invariance:
        print(real_invariance.table(photographs if invariance == "real" else None, params, scenes))
    return 0


def summary(outcomes: Sequence[Outcome]) -> list[list[object]]:
    """One line a set, and one for all of them: overlaps, shares of the lost area, times."""
    head = ["set", "images", "iou", "even", "odd", "goal", "median", "failed", "missed", "leaked", "ms", "ratio"]
    groups = {one.photograph.folder: [o for o in outcomes if o.photograph.folder == one.photograph.folder]
              for one in outcomes}  # fmt: skip
    lines = [[name, *_figures(group, GOALS.get(name))] for name, group in groups.items()]
    return [head, *lines, ["all", *_figures(outcomes, None)]]


def _figures(group: Sequence[Outcome], goal: float | None) -> list[object]:
    halves = [[one.overlap for one in group if one.photograph.half == half] for half in (0, 1)]
    missed, leaked = (float(np.mean([lost(one)[kind] for one in group])) for kind in (0, 1))
    overlaps = [one.overlap for one in group]
    means = [round(mean(half), 3) if half else "" for half in (overlaps, *halves)]
    times = [median(one.segment_ms for one in group), median(one.segment_ms / one.edge_map_ms for one in group)]
    failed = sum(one.result is None for one in group)
    shares = [round(missed, 3), round(leaked, 3)]
    return [len(group), *means, goal or "", round(median(overlaps), 3), failed, *shares, *(round(t, 2) for t in times)]


def lost(one: Outcome) -> tuple[float, float]:
    """Missed and leaked area as parts of truth and result together: what both take from an IoU of 1."""
    missed, leaked = np.count_nonzero(one.missed), np.count_nonzero(one.leaked)
    either = np.count_nonzero((one.photograph.truth == INSIDE) | one.leaked)
    return missed / max(1, either), leaked / max(1, either)


def about_scores(outcomes: Sequence[Outcome]) -> str:
    """Whether the score ranks the images as their overlap does."""
    sure = [(score(one.result), one.overlap) for one in outcomes]
    pairs = sorted((float(s), o) for s, o in sure if s is not None)
    if len(pairs) < 3:
        return "score: none"
    tenth = pairs[: max(1, round(len(pairs) / 10))]
    right = mean(o < POOR for _, o in tenth)
    rho = spearman([s for s, _ in pairs], [o for _, o in pairs])
    return f"score: Spearman {rho:.3f} over {len(pairs)} images; of the {len(tenth)} ranked worst {right:.0%} are poor"


def spearman(a: Sequence[float], b: Sequence[float]) -> float:
    """Rank correlation; ties share their mean rank. NaN where one side does not vary."""
    ranks = [_ranks(np.asarray(values, np.float64)) for values in (a, b)]
    if min(np.ptp(rank) for rank in ranks) == 0:
        return float("nan")
    return float(np.corrcoef(ranks)[0, 1])


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray((last - (count - 1) / 2)[place], np.float64)


def changes(outcomes: Sequence[Outcome], before: Path) -> str:
    """What became better or worse by more than .05 since an earlier table."""
    with before.open(encoding="utf-8", newline="") as file:
        old = {(row["set"], row["image"]): float(row["iou"]) for row in csv.DictReader(file)}
    lines = []
    for one in outcomes:
        was = old.get((one.photograph.folder, one.photograph.name))
        if was is not None and abs(one.overlap - was) > 0.05:
            lines.append(
                (one.overlap - was, f"{was:.3f} -> {one.overlap:.3f} {one.photograph.folder} {one.photograph.name}")
            )
    lines.sort()
    worse = sum(change < 0 for change, _ in lines)
    return "\n".join([f"since {before}: {len(lines) - worse} better, {worse} worse", *(text for _, text in lines)])


def worst(outcomes: Sequence[Outcome], count: int) -> list[Outcome]:
    """The outcomes with the lowest overlap."""
    return sorted(outcomes, key=lambda one: one.overlap)[:count]


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
    for line, text in enumerate((f"{one.name} IoU {outcome.overlap:.3f}", outcome.message)):
        cv2.putText(caption, text, (4, 13 + 15 * line), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return encode_png(np.vstack([caption, canvas]), [cv2.IMWRITE_PNG_COMPRESSION, 3])


def aligned(table: Sequence[Sequence[object]]) -> str:
    """A table in columns of equal width."""
    widths = [max(len(str(line[column])) for line in table) for column in range(len(table[0]))]
    return "\n".join(
        "  ".join(str(cell).ljust(width) for cell, width in zip(line, widths, strict=True)) for line in table
    )


if __name__ == "__main__":
    harness.as_command(main)
