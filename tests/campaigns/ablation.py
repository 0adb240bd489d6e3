"""What each departure from the paper gains: switched off in turn, on random scenes and the samples.

``python -m tests.campaigns.ablation --work DIR [--scenes 100]``

Prints a table for docs/method.md: scenes with a fault (not converged, contours that cross, IoU below 0.99, holes that do
not fit the truth), the least and the mean overlap, and the time of the evolution over that of the whole method, all in
one build. The printed method is the last row; it is not asked for its holes, which folds of the front add to.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean

from tests.campaigns import harness
from tests.campaigns.mutations import ROOT, Fault, named, native_core

MARK = "figures: "
HERE = "native/freeform/"


@dataclass(frozen=True)
class Departure:
    """What the paper does not have, and how to do without it."""

    name: str
    faults: tuple[Fault, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


def _without(name: str, file: str, *olds: str, new: str = "false") -> Departure:
    """A departure that other text in a file of the core switches off: statements are left out."""
    texts = ((old, "" if old.endswith(";") else new) for old in olds)
    return Departure(name, tuple(named(HERE + file, *text) for text in texts))


DEPARTURES = (
    Departure("none: the method as it is"),
    Departure("attraction after the contour has stopped (`contour.settle`)", settings={"contour.settle": 0}),
    _without(
        "settled contours untangled", "evolution.cpp",
        "if (options.topology) settling::Untangle<D>(settled_).run();",
    ),
    _without(
        "settled contours laid out every 3 px (but 12)", "settling/settle.hpp",
        "std::min(spacing, kSettledSpacing)", new="std::min(spacing, 4 * kSettledSpacing)",
    ),
    _without(
        "steps near edges of at most 2 px (but 5)", "deform.hpp",
        "std::max(kCautiousStep, known)", new="std::max(5.0, known)",
    ),
    _without(
        "the curve between samples kept off edges", "deform.hpp",
        "free + ahead < kBulge * motion.chord[k] + 2 * contour.options.balloon",
    ),
    _without(
        "patches that meet an edge split", "refine.hpp",
        "patch.wants_split && patch.budget > 0 && contour.splittable(i)",
    ),
    _without("short patches pruned while it grows", "refine.hpp", "size < shortest && prune(contour, i)"),
    _without("folds straightened", "refine.hpp", "dot(after, before) < 0"),
    _without("curves that swing made of a lower degree", "refine.hpp", "polygon > kOscillation * size"),
    _without("adjacent patches flipped as well", "topology/flip.hpp", "flip_adjacent(contour, contour.active[at]);"),
    _without(
        "patches that may hold an edge halved before they flip", "topology/flip.hpp",
        "std::max(contour.length(i), contour.length(j)) > kFlipLength",
    ),
    _without(
        "curves joined at their crossing where swapped halves cross", "topology/exchange.hpp",
        "if (visit_crossings(p, q, [](int, int) { return true; })) return false;",
    ),
    _without("components of negligible area dropped", "topology/classify.hpp", "std::abs(area) < kVoidArea"),
    Departure(
        "what lies in ground covered already dropped",
        (
            *_without(
                "", "topology/classify.hpp",
                "beside > 0 && std::isfinite(beside) && is_nested(contour, large)",
                "if ((real && small == inner) || is_nested(contour, small)) drop(contour, small);",
                "if (contains(contour, outer, contour[within].m[0])) drop_or_wait(within);",
            ).faults,
            *_without(
                "", "evolution.cpp", "if (contour_.options.topology) topology::drop_nested(contour_);"
            ).faults,
        ),
    ),
    _without(
        "edges 4-connected", "field/field.cpp",
        "here | (above & ((left & (up_left ^ kOnes)) | (right & (up_right ^ kOnes))))", new="here",
    ),
)  # fmt: skip
FAULTS = tuple(fault for departure in DEPARTURES for fault in departure.faults)


def measure(settings: Mapping[str, object], scenes: int, method: str) -> dict[str, float]:
    """Figures of the core that is in place."""
    from tests import stress

    found = [stress.check(seed, {"method": method, **settings}) for seed in range(scenes)]
    asked = ("stopped", "IoU") if method == "paper" else ("",)
    faulty = sum(any(fault.startswith(asked) for fault in one.faults) for one in found)
    ious = [one.iou for one in found if one.wide]
    return {"faulty": faulty, "least": min(ious), "mean": mean(ious), "ms": mean(one.evolve_ms for one in found)}


def row(core: Path, departure: Departure, scenes: int, method: str = "freeform") -> dict[str, float] | str:
    """Figures with some switches on, or how the process ended without any."""
    numbers = ",".join(str(FAULTS.index(fault) + 1) for fault in departure.faults)
    env = {**os.environ, "FFSEG_OTHER_CORE": str(core), "FFSEG_MUTANT": numbers}
    what = json.dumps({"settings": dict(departure.settings), "scenes": scenes, "method": method})
    command = [sys.executable, "-m", "tests.campaigns.ablation", "--measure", what]
    try:
        done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=300, check=False)
    except subprocess.TimeoutExpired:
        return "does not end within five minutes"
    if done.returncode > 0:
        raise RuntimeError(done.stderr)
    if done.returncode < 0:
        return "crashes"
    found = [line for line in done.stdout.splitlines() if line.startswith(MARK)]
    return dict(json.loads(found[0].removeprefix(MARK)))


def main(work: harness.Work, scenes: int = 100) -> int:
    """Print the table."""
    core = native_core(work, FAULTS)
    print("| without | faulty scenes | least IoU | mean IoU | evolution, times |\n| --- | --- | --- | --- | --- |")
    begin, whole = time.monotonic(), 0.0
    for departure in (*DEPARTURES, Departure("`method: paper`")):
        method = "paper" if departure.name == "`method: paper`" else "freeform"
        found = row(core, departure, scenes, method)
        if isinstance(found, str):
            figures = f"{found} | | |"
        else:
            whole = whole or found["ms"]
            figures = f"{found['faulty']} of {scenes} | {found['least']:.4f} | {found['mean']:.4f} | {found['ms'] / whole:.1f}"
        print(f"| {departure.name} | {figures} |", flush=True)
    harness.say(f"{time.monotonic() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    if "--measure" in sys.argv:
        from tests.campaigns import other_core  # noqa: F401 - puts the core in place

        print(MARK + json.dumps(measure(**json.loads(sys.argv[-1]))))
        sys.exit(0)
    harness.as_command(main)
