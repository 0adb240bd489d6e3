"""The parameters at hand on four sets of real images with truth: overlap, how sure it was, and what it cost.

Run ``python -m tests.campaigns.real_sets [--data DATA] [--half even|odd] [--config FILE] [--set KEY=VALUE]... [--sets a,b]
[--size 640x480]``.
DATA (or the environment variable FFSEG_DATA) holds the folders of `SETS`, each with ``images/``, ``truth/`` (255 inside,
128 ignored) and ``seeds.csv``; folders that are absent are named and left out. An image that fails counts as IoU 0.

``--invariance real`` checks that turning, shifting, dimming and moving the start change nothing. With ``--size`` the
photographs are first brought to that size.
Images sorted by name: those at even places are one half, those at odd places the other. ``ffseg run`` and ``ffseg report`` show
the regions beside their truths.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import mean, median
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from ffseg.io.images import prepare_worker
from ffseg.parameter_files import load_params
from tests.campaigns import harness, real_invariance
from tests.campaigns.real_images import SETS, Outcome, evaluate, load
from tests.real_data import data_folder

HALVES = ("even", "odd")


def main(
    data: Path = data_folder(), sets: str = ",".join(SETS), half: str = "", config: str | None = None,
    settings: Annotated[list[str] | None, typer.Option("--set")] = None, invariance: str = "",
    size: str = "",
) -> int:  # fmt: skip
    """Run the campaign; 0 also when the images are absent."""
    folders = sets.split(",")
    for folder in folders:
        if not (data / folder / "seeds.csv").is_file():
            print(f"left out: {folder} has no seeds.csv in {data}")
    photographs = [one for one in load(data, folders) if half in ("", HALVES[one.half])]
    if not photographs:
        print(f"skipped: none of the sets is in {data}; name the folder with --data or FFSEG_DATA")
        return 0
    if size:
        shorter, longer = sorted(map(int, size.split("x")))
        photographs = [one.of_size(longer, shorter) for one in photographs]
    prepare_worker()
    params = load_params(config, settings or [])
    print("\n".join(summary([evaluate(one, params) for one in photographs])))
    if invariance:
        print(real_invariance.table(photographs, params))
    return 0


def summary(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """A table: a line for each half of a set, and one for each half of all."""
    yield "| set | half | images | IoU | score | Spearman | sure and wrong | edge maps |"
    yield "| --- " * 8 + "|"
    for folder in (*dict.fromkeys(one.photograph.folder for one in outcomes), "all"):
        for half, name in enumerate(HALVES):
            group = [o for o in outcomes if o.photograph.half == half and folder in ("all", o.photograph.folder)]
            if group:
                yield f"| {folder} | {name} | {len(group)} | " + " | ".join(_figures(group)) + " |"


def _figures(group: Sequence[Outcome]) -> tuple[str, ...]:
    overlaps, scores = [one.overlap for one in group], [one.score for one in group]
    wrong = sum(score >= 0.9 and overlap < 0.5 for score, overlap in zip(scores, overlaps, strict=True))
    cost = median(one.segment_ms / one.edge_map_ms for one in group)
    figures = mean(overlaps), mean(scores), spearman(scores, overlaps)
    return *(f"{figure:.3f}" for figure in figures), f"{wrong}", f"{cost:.1f}"


def spearman(a: Sequence[float], b: Sequence[float]) -> float:
    """Rank correlation; ties share their mean rank. NaN where one side does not vary."""
    ranks = [_ranks(np.asarray(values, np.float64)) for values in (a, b)]
    if min(np.ptp(rank) for rank in ranks) == 0:
        return float("nan")
    return float(np.asarray(np.corrcoef(ranks))[0, 1])


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return np.asarray((last - (count - 1) / 2)[place], np.float64)


if __name__ == "__main__":
    harness.as_command(main)
