"""The paper's lemmas on cost, measured on the printed method: ``python -m tests.campaigns.lemmas``.

Lemmas 1 to 3: moving and splitting a patch cost what two products of a (d + 1) x (d + 1) matrix with a vector cost, so the
time of a patch over (d + 1)^2 must not grow with the degree. Lemma 4: sorting takes at most a multiple of N log N
comparisons. Lemma 5: an iteration without a change of topology takes a time linear in the number of patches.
"""

import sys
import time
from collections.abc import Callable
from math import log, log2

import numpy as np

from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.ragged import packed
from ffseg.native import _core

SHAPE = (900, 900)
ROUNDS = 7
"""The least of so many times counts: what disturbs a measurement only adds to it."""
PATCHES = (250, 500, 1000, 2000, 4000, 8000)


def circle(patches: int, degree: int, threshold: float = 1e6) -> _core.PaperEvolution:
    """A circle of many patches in open ground, which moves a little in every iteration."""
    options = _core.PaperOptions()
    options.degree, options.split_threshold, options.max_iterations = degree, threshold, 1000
    options.balloon, options.exponent, options.sigma = 0.2, 2.0, 1.5
    options.topology = True
    start = FreeForm.circle((450, 450), 400, patches, degree)
    plane = np.zeros(SHAPE, np.uint16)
    return _core.PaperEvolution(*packed([start]), plane, np.zeros(SHAPE, np.uint8), None, options)


def least(make: Callable[[], _core.PaperEvolution], work: Callable[[_core.PaperEvolution], object]) -> float:
    """Seconds of the fastest of several rounds."""
    seconds = []
    for _ in range(ROUNDS):
        made = make()
        begin = time.perf_counter()
        work(made)
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def main() -> int:
    """Print three tables."""
    count = 2000
    print("| degree | split, ns a patch | over (d + 1)^2 | move and filter, ns a patch | over (d + 1)^2 |")
    print("| --- | --- | --- | --- | --- |")
    for degree in range(1, 7):
        split = least(lambda d=degree: circle(count, d, 1.0), lambda made: made.split()) / count * 1e9
        moved = least(lambda d=degree: circle(count, d), lambda made: made.step()) / count * 1e9
        size = (degree + 1) ** 2
        print(f"| {degree} | {split:.0f} | {split / size:.0f} | {moved:.0f} | {moved / size:.0f} |")
    print(
        "\n| patches | comparisons of the sort | over N log2 N | iteration, ms | us a patch |\n| --- | --- | --- | --- | --- |"
    )
    times = []
    for patches in PATCHES:
        made = circle(patches, 3)
        made.flip()
        compared = made.counts()["comparisons"]
        seconds = least(lambda n=patches: circle(n, 3), lambda one: one.step())
        times.append(seconds)
        share = compared / (patches * log2(patches))
        print(f"| {patches} | {compared} | {share:.2f} | {1e3 * seconds:.2f} | {1e6 * seconds / patches:.2f} |")
    slope = np.polyfit([log(n) for n in PATCHES], [log(t) for t in times], 1)[0]
    print(f"\nexponent of the time of an iteration: {slope:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
