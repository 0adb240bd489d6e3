"""Which scene fails without a rule of the core: ``python -m tests.campaigns.ablation --work DIR``.

Switches what the free form has and the paper has not off in turn, in one build, on the scenes of `grounds`. For
docs/pipeline.md it prints of each rule the scene that loses most, its IoU with and without, and how many lose more than `LOSS`.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path

from tests.campaigns import harness
from tests.campaigns.mutations import ROOT, Fault, named, native_core

MARK, LOSS, LIMIT_S = "figures: ", 0.005, 900


@dataclass(frozen=True)
class Rule:
    """What is switched off, and how."""

    name: str
    faults: tuple[Fault, ...] = ()
    settings: Mapping[str, object] = field(default_factory=dict)


CORE: dict[str, tuple[tuple[str, str, str], ...]] = {
    "field/field.cpp": (
        ("slits are blocked", "above & below & ~here & kOnes", "0 * here"),
        ("edges are 4-connected", "here | (above & ((left & (up_left ^ kOnes)) | (right & (up_right ^ kOnes))))", "here"),
    ),
    "deform.hpp": (
        ("the curve is off edges between samples",
         "free + ahead < kBulge * motion.chord[k] + 2 * contour.options.balloon", "false"),
        ("steps near edges of at most 2 px (but 5)", "std::max(kCautiousStep, known)", "std::max(5.0, known)"),
    ),
    "guard.hpp": (
        ("the curve is looked at between the places tested", "1 + static_cast<int>(std::sqrt(gap2) / kTestEvery)", "1"),
        ("samples farther off are put back, too", "ring < D && !any", "false"),
    ),
    "refine.hpp": (
        ("patches that an edge stops are split", "patch.wants_split && patch.budget > 0 && contour.splittable(i)", "false"),
        ("repairs come back where a patch gets on", "patch.budget = kSplitBudget;", ""),
        ("uneven samples are laid out anew", "chords.longest <= kUneven * chords.shortest", "true"),
        ("curves that swing get a lower degree", "polygon > kOscillation * size", "false"),
        ("... and are split or held", "if (patch.near_edges && patch.reductions < kMaxReductions) ++patch.reductions;", ""),
        ("short patches are pruned while it grows", "size < shortest && prune(contour, i)", "false"),
        ("folds are straightened", "dot(after, before) < 0", "false"),
    ),
    "topology/flip.hpp": (
        ("adjacent patches flip", "flip_adjacent(contour, contour.active[at]);", ""),
        ("patches that may hold an edge are halved", "std::max(contour.length(i), contour.length(j)) > kFlipLength", "false"),
        ("several rounds of flips", "round < kFlipRounds", "round < 1"),
    ),
    "topology/exchange.hpp": (
        ("curves join at their crossing where halves cross",
         "if (visit_crossings(p, q, [](int, int) { return true; })) return false;", ""),
    ),
    "topology/classify.hpp": (("components of negligible area are dropped", "std::abs(area) < kVoidArea", "false"),),
    "resting/rest.hpp": (
        ("a patch at rest is split where it could go on", "contour.splittable(i) && can_advance<false>(contour, i)", "false"),
        ("... and looked at closely before the end", "can_advance<true>(contour, i)", "false"),
        ("samples at a tip slide on", "!slide(contour, i)", "true"),
    ),
    "resting/slide.hpp": (("... by pixels", "turns_back && move_to_pixel(contour, at, points[k + 1], hindered)", "false"),),
    "settling/settle.hpp": (
        ("settled samples every 3 px (but 12)", "std::min(spacing, kSettledSpacing)", "std::min(spacing, 4 * kSettledSpacing)"),
        ("... that follow the curve where they are few", "at_ = with_bends<D>(at_, kMaxBend * reach_);", ""),
        ("lone departures take the median", "std::abs(here - median) > kRidgeOutlier", "false"),
        ("patches that miss the ridge are split", "std::abs(off) > kRidgeMiss", "false"),
        ("a last look at the ridge", "project(0.0, -1.0, 1.0);", ""),
    ),
    "evolution.cpp": (
        ("settled contours are untangled", "!settling::Untangle<D>(settled).run()", "false"),
        ("... and dropped where they bound nothing",
         "if (!bounding[i]) settled.erase(settled.begin() + static_cast<std::ptrdiff_t>(i));", ""),
    ),
}  # fmt: skip
"""Of each file the rules, some text that is one, and what stands in its place without it."""
COVERED = {
    "topology/classify.hpp": (
        ("beside > 0 && std::isfinite(beside) && is_nested(contour, large)", "false"),
        ("if ((real && small == inner) || is_nested(contour, small)) drop(contour, small);", ""),
        ("if (contains(contour, outer, contour[within].m[0])) drop_or_wait(within);", ""),
    ),
    "evolution.cpp": (("if (!bounding[i]) topology::drop(contour_, loops[i]);", ""),),
}


def _fault(file: str, old: str, new: str) -> Fault:
    return named("native/freeform/" + file, old, new)


RULES = (
    *(Rule(name, (_fault(file, old, new),)) for file, rules in CORE.items() for name, old, new in rules),
    Rule("ground covered already is dropped", tuple(_fault(f, *text) for f, own in COVERED.items() for text in own)),
    Rule("attraction after the contour has stopped (`contour.settle`)", settings={"contour.settle": 0}),
)
FAULTS = tuple(fault for rule in RULES for fault in rule.faults)


def row(core: Path, rule: Rule) -> dict[str, float] | str:
    """IoU of all scenes without a rule, or how the process ended without any."""
    numbers = ",".join(str(FAULTS.index(fault) + 1) for fault in rule.faults)
    env = {**os.environ, "FFSEG_OTHER_CORE": str(core), "FFSEG_MUTANT": numbers}
    command = [sys.executable, "-m", "tests.campaigns.ablation", "--measure", json.dumps(dict(rule.settings))]
    try:
        done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return f"does not end within {LIMIT_S / 60:g} minutes"
    if done.returncode > 0:
        raise RuntimeError(done.stderr)
    if done.returncode < 0:
        return "crashes"
    found = [line for line in done.stdout.splitlines() if line.startswith(MARK)]
    return dict(json.loads(found[0].removeprefix(MARK)))


def told(whole: Mapping[str, float], without: Mapping[str, float] | str) -> str:
    """Cells of a row: the scene that loses most, its IoU with and without the rule, and how many lose."""
    if isinstance(without, str):
        return f"{without} | | |"
    lost = {scene: overlap - without[scene] for scene, overlap in whole.items()}
    worst = max(lost, key=lambda scene: lost[scene])
    many = sum(one > LOSS for one in lost.values())
    return f"{worst} | {whole[worst]:.3f} | {without[worst]:.3f} | {many}" if many else "none | | | 0"


def main(work: harness.Work, jobs: int = 2) -> int:
    """Print the table."""
    core = native_core(work, FAULTS)
    with ThreadPoolExecutor(jobs) as pool:
        whole, *rows = pool.map(row, repeat(core), (Rule("none"), *RULES))
    if isinstance(whole, str):
        raise TypeError(whole)
    print(f"| rule of the core | scene that loses most of {len(whole)} | IoU with it | without | scenes that lose |")
    print("| --- | --- | --: | --: | --: |")
    for rule, found in zip(RULES, rows, strict=True):
        print(f"| {rule.name} | {told(whole, found)} |")
    return 0


if __name__ == "__main__":
    if "--measure" in sys.argv:
        from tests.campaigns import other_core  # noqa: F401 - puts the core in place before the package is imported
        from tests.campaigns.grounds import scenes

        print(MARK + json.dumps({name: judge() for name, judge in scenes(json.loads(sys.argv[-1]))}))
        sys.exit(0)
    harness.as_command(main)
