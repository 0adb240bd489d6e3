"""How well a model of a few masks does on real images that it has not seen, and what it costs.

Run ``python -m tests.campaigns.learning --data DATA [--sets road,real_floors/indoor] [--masks 1,3,5,10] [--draws 5]``.
DATA (or FFSEG_DATA) holds the folders of `real_images.SETS`. ``road`` is learned at even places of the sorted names and
tested at odd ones; of the other sets some images are drawn to learn from, and the rest is tested. Each figure is the mean
over the draws of the mean IoU of the contour. ``--times`` compares the parts of using a model with LightGBM's own
prediction, in ms of processor time.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean, median, pstdev

import numpy as np
from numpy.typing import NDArray

from ffseg.evidence.features import KNOWN
from ffseg.evidence.forest import Model
from ffseg.evidence.learning import RATE, SETTINGS, TREES, Example, Samples, learn, samples
from ffseg.evidence.maps import evidence_edges
from ffseg.formats.images import single_thread
from ffseg.image.edges import edge_map
from ffseg.metrics import iou
from ffseg.parameters import Edges, load_params
from ffseg.segmenters.registry import segment
from tests.campaigns.real_images import Photograph, load

GOALS = {("road", 1): 0.68, ("road", 3): 0.78, ("road", 5): 0.82, ("road", 10): 0.85, ("real_floors/indoor", 5): 0.78}
"""Mean IoU wanted, by set and number of masks."""
REPEATS = 5


def main() -> int:
    """Run the campaign; 0 also when the images are absent."""
    options = _options()
    single_thread()
    for folder in options.sets.split(","):
        photographs = list(load(options.data, [folder]))
        if not photographs:
            say(f"skipped: {folder} is not in {options.data}; name the folder with --data or FFSEG_DATA")
            continue
        chosen = [samples(Example(p.image, p.truth, start_of(p), p.circle[2])) for p in photographs]
        evaluate(photographs, chosen, [int(number) for number in options.masks.split(",")], options.draws)
        if options.times:
            costs(photographs[0], chosen[:5])
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    beside = Path(__file__).resolve().parents[3] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("FFSEG_DATA", beside)), help="image sets")
    parser.add_argument("--sets", default="road,real_floors/indoor", help="folders separated by commas")
    parser.add_argument("--masks", default="1,3,5,10", help="numbers of masks to learn from")
    parser.add_argument("--draws", type=int, default=5, help="random choices of masks at each number")
    parser.add_argument("--times", action="store_true", help="measure what using a model costs")
    return parser.parse_args()


def start_of(photograph: Photograph) -> NDArray[np.bool_]:
    """Pixels in the start circle."""
    x, y, radius = photograph.circle
    rows, columns = np.indices(photograph.truth.shape, sparse=True)
    return np.asarray((columns - x) ** 2 + (rows - y) ** 2 <= radius**2)


def evaluate(photographs: Sequence[Photograph], chosen: Sequence[Samples], masks: Sequence[int], draws: int) -> None:
    """Say the figures of one set."""
    folder, count = photographs[0].folder, len(photographs)
    pool = list(range(0, count, 2)) if folder == "road" else list(range(count))
    plain = mean(overlap(one, None) for one in photographs)
    say(f"{folder}: {count} images, without a model {plain:.3f}")
    for number in masks:
        if number > len(pool) or number >= count:
            continue
        rng, found = np.random.default_rng(1), []
        for _ in range(1 if number == len(pool) else draws):
            drawn = sorted(rng.choice(pool, number, replace=False).tolist())
            model = learn([chosen[i] for i in drawn], searched=False)
            rest = range(1, count, 2) if folder == "road" else [i for i in range(count) if i not in drawn]
            found.append(mean(overlap(photographs[i], model) for i in rest))
        goal = GOALS.get((folder, number))
        wanted = f", wanted {goal}" if goal else ""
        say(f"{folder}: {number} masks: {mean(found):.3f} (spread of the draws {pstdev(found):.3f}){wanted}")


def overlap(one: Photograph, model: Model | None) -> float:
    """IoU of the contour from the start circle."""
    evidence = None if model is None else model.map(model.look(one.image, start_of(one)))
    return iou(segment(one.image, one.placed(load_params()), evidence=evidence).mask, one.truth)


def costs(one: Photograph, chosen: Sequence[Samples]) -> None:
    """Say what the parts of using a model cost, at the size of an image and at 800x600."""
    import lightgbm

    begin = time.process_time()
    model = learn(chosen)
    say(f"growing from {len(chosen)} masks: {time.process_time() - begin:.1f} s")
    data = lightgbm.Dataset(chosen[0].rows, chosen[0].inside.astype(np.float32))
    booster = lightgbm.train({**SETTINGS, "learning_rate": RATE}, data, TREES)
    for image, start in ((one.image, start_of(one)), stretched(one)):
        seen, native = model.look(image, start), model.inside.compiled()
        rows = np.ascontiguousarray(seen.planes.reshape(len(KNOWN), -1).T)
        probability, own = model.map(seen, native), edge_map(image, Edges())
        parts: dict[str, Callable[[], object]] = {
            "features": lambda image=image, start=start: model.look(image, start),
            "forest": lambda seen=seen, native=native: model.map(seen, native),
            "edges": lambda probability=probability, own=own: evidence_edges(probability, own),
            "LightGBM": lambda rows=rows: booster.predict(rows, num_threads=1),
        }
        told = ", ".join(f"{name} {milliseconds(work):.1f} ms" for name, work in parts.items())
        say(f"{image.shape[1]}x{image.shape[0]}: {told}")


def stretched(one: Photograph) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """The image at 800x600, pixels repeated."""
    rows = np.arange(600) * one.image.shape[0] // 600
    columns = np.arange(800) * one.image.shape[1] // 800
    return np.ascontiguousarray(one.image[rows][:, columns]), start_of(one)[rows][:, columns]


def milliseconds(work: Callable[[], object]) -> float:
    """Median processor time."""
    found = []
    for _ in range(REPEATS):
        begin = time.process_time()
        work()
        found.append((time.process_time() - begin) * 1e3)
    return median(found)


def say(text: str) -> None:
    """Print a figure."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
