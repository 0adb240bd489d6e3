"""What each departure from the paper gains: switched off in turn, on random scenes and the samples.

``python -m tests.campaigns.ablation --work DIR [--scenes 100]``

Prints a table for docs/method.md: scenes with a fault (not converged, contours that cross, IoU below 0.99, holes that do
not fit the truth), the least and the mean overlap, and the time of the evolution beside that of the whole method, all in
one build. The printed method is the last row; it is not asked for its holes, which folds of the front add to.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import harness
from mutants import FREEFORM, Mutant
from mutations import ROOT, native_core

MARK = "figures: "


@dataclass(frozen=True)
class Departure:
    """What the paper does not have, and how to do without it."""

    name: str
    faults: tuple[Mutant, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


def _without(name: str, *changes: tuple[str, str, str]) -> Departure:
    return Departure(name, tuple(Mutant(FREEFORM + file, old, new) for file, old, new in changes))


DEPARTURES = (
    Departure("none: the method as it is"),
    Departure("attraction after the contour has stopped (`contour.settle`)", settings={"contour.settle": 0}),
    _without(
        "settled contours are untangled", ("evolution.cpp", "if (options_.topology) Untangle<D>(settled_).run();", "")
    ),
    _without(
        "a settled contour is laid out anew every 3 px",
        ("settle.hpp", "lay_out(std::min(spacing, kSettledSpacing));", "lay_out(spacing);"),
    ),
    _without("short steps near edges", ("move.hpp", "std::max(kCautiousStep, known)", "wanted")),
    _without(
        "the curve between samples is kept off edges",
        ("move.hpp", "free + ahead < kBulge * motion.chord[k] + 2 * options_.balloon", "false"),
    ),
    _without(
        "patches that meet an edge are split",
        ("refine.hpp", "pool_[i].wants_split && pool_[i].budget > 0 && splittable(i)", "false"),
    ),
    _without("samples are spaced evenly along the tangent", ("move.hpp", "0.25 * (motion.chord[k] - back)", "0.0")),
    _without("short patches are pruned while it grows", ("refine.hpp", "size < shortest && remove(i)", "false")),
    _without("folds are straightened", ("refine.hpp", "dot(after, before) < 0", "false")),
    _without("curves that swing take a lower degree", ("refine.hpp", "polygon > kSwing * size", "false")),
    _without(
        "adjacent patches flip as well",
        ("flip.hpp", "for (std::size_t at = 0; at < count; ++at) flip_adjacent(active_[at]);", ""),
    ),
    _without(
        "patches that may hold an edge are halved before they flip",
        ("flip.hpp", "std::max(length(i), length(j)) > kFlipLength", "false"),
    ),
    _without(
        "where swapped halves cross, curves are joined at their crossing",
        ("flip.hpp", "if (visit_crossings(p, q, [](int, int) { return true; })) return false;", ""),
    ),
    _without("components of negligible area are dropped", ("components.hpp", "std::abs(area) < kVoidArea", "false")),
    _without(
        "what lies in ground covered already is dropped",
        ("components.hpp", "beside > 0 && std::isfinite(beside) && nested(large)", "false"),
        ("components.hpp", "if ((real && small == inner) || nested(small)) drop(small);", ""),
        ("components.hpp", "if (loop_contains(outer, pool_[within].m[0])) drop_or_wait(within);", ""),
    ),
    _without(
        "edges are made 4-connected",
        ("field.cpp", "here | (above & ((left & (up_left ^ kOnes)) | (right & (up_right ^ kOnes))))", "here"),
    ),
)
SWITCHES = tuple(dict.fromkeys(fault for departure in DEPARTURES for fault in departure.faults))


def measure(settings: Mapping[str, object], scenes: int, method: str) -> dict[str, float]:
    """Figures of the core that is in place."""
    import numpy as np

    import ffseg
    from tests import scenes as drawn
    from tests.campaigns import stress

    ious, faulty, seconds = [], 0, 0.0
    start = {"init.center": list(drawn.START), "init.radius": drawn.START_RADIUS, "method": method}
    for seed in range(scenes):
        scene = drawn.scene(seed)
        result = ffseg.segment(scene.image, ffseg.load_params(None, {**start, **settings}))
        seconds += result.timings.evolve_ms / 1e3
        iou = float(np.sum(result.mask & scene.truth) / np.sum(result.mask | scene.truth))
        fault = result.stats.stop_reason != "converged"
        if method == "freeform":
            fault |= not stress.is_simple(result.contours) or (scene.wide and result.num_holes != scene.holes)
        if scene.wide:
            ious.append(iou)
            fault |= iou < stress.LEAST_IOU
        faulty += bool(fault)
    return {"faulty": faulty, "least": min(ious), "mean": float(np.mean(ious)), "ms": 1e3 * seconds / scenes}


def row(core: Path, departure: Departure, scenes: int, method: str = "freeform") -> dict[str, float] | None:
    """Figures with some switches on; None when the process does not end within minutes or crashes."""
    numbers = ",".join(str(1 + SWITCHES.index(fault)) for fault in departure.faults)
    env = {**os.environ, "FFSEG_OTHER_CORE": str(core), "FFSEG_MUTANT": numbers}
    what = json.dumps({"settings": dict(departure.settings), "scenes": scenes, "method": method})
    command = [sys.executable, "-m", "tests.campaigns.ablation", "--measure", what]
    try:
        done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=300, check=False)
    except subprocess.TimeoutExpired:
        return None
    found = [line for line in done.stdout.splitlines() if line.startswith(MARK)]
    return json.loads(found[0].removeprefix(MARK)) if found else None


def main() -> int:
    """Print the table."""
    arguments = harness.parser(__doc__)
    arguments.add_argument("--scenes", type=int, default=100)
    given = arguments.parse_args()
    core = native_core(given.work, SWITCHES)
    print("| without | faulty scenes | least IoU | mean IoU | evolution ms |\n| --- | --- | --- | --- | --- |")
    begin = time.monotonic()
    for departure in (*DEPARTURES, Departure("`method: paper`")):
        method = "paper" if departure.name == "`method: paper`" else "freeform"
        found = row(core, departure, given.scenes, method)
        figures = "does not end within five minutes | | |" if found is None else (
            f"{found['faulty']} of {given.scenes} | {found['least']:.4f} | {found['mean']:.4f} | {found['ms']:.1f}"
        )  # fmt: skip
        print(f"| {departure.name} | {figures} |", flush=True)
    harness.say(f"{time.monotonic() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    if "--measure" in sys.argv:
        import other_core  # noqa: F401 - puts the core in place

        print(MARK + json.dumps(measure(**json.loads(sys.argv[-1]))))
        sys.exit(0)
    sys.exit(main())
