"""Free space on rendered pairs: with poses, with noisy poses and without; run ``python -m tests.campaigns.freespace``.

Says for every mode: boxes merged (there must be none), enclosed marks merged, mean IoU of the free space, and translation
error of the motion. With ``--snake`` the same of the snake, without its altitude term (Eq. 11) and with it.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.motion import Pose, planar_pose, relative_motion
from ffseg.freespace.sequence import Frame, Sequence, free_space, segment_view
from ffseg.metrics import IGNORED, INSIDE, iou
from ffseg.parameters import Parameters, load_params
from ffseg.rendering import RenderedPair, render_pair
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL, GROUND
from tests.campaigns import harness

MODES = ("poses", "noisy", "none")
NOISE_METRES, NOISE_RADIANS = 0.02, np.deg2rad(0.5)
"""Of the pose noise: relative to the baseline per axis, and absolute."""
MARK_FREE = 0.9
"""Share of a mark's pixels that must be free; its border pixels are mixed."""
BOX_FREE = 0.05
"""Share of a box's pixels that may be free; its border pixels are mixed."""
RING = 6
"""Pixels of plain ground round a mark for it to count as enclosed: the contour needs room to pass."""


@dataclass
class Tally:
    """Counts over pairs."""

    boxes: int = 0
    boxes_merged: int = 0
    marks: int = 0
    marks_merged: int = 0
    ious: list[float] = field(default_factory=list)
    shift_errors: list[float] = field(default_factory=list)
    misses: list[str] = field(default_factory=list)


def enclosed_marks(pair: RenderedPair) -> list[int]:
    """Labels of marks with plain ground all round them, away from the start circle."""
    labels = pair.current.labels
    found = []
    for label in range(1, len(pair.scene.marks) + 1):
        mark = labels == label
        if mark.any() and np.all(np.isin(labels[ring(mark)], (GROUND, label))):
            found.append(label)
    return found


def ring(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The mask grown by ``RING`` pixels."""
    grown = mask.copy()
    for axis in (0, 1):
        for step in range(1, RING + 1):
            grown |= np.roll(mask, step, axis) | np.roll(mask, -step, axis)
        mask = grown.copy()
    return grown


def count_things(
    pair: RenderedPair, marks: list[int], frame: Frame, tally: Tally, name: str, told: NDArray[np.bool_] | None = None
) -> None:
    """Add the boxes of a pair to the tally, judged by the pixels that `told` holds, and the marks of these labels."""
    labels = pair.current.labels
    for label in range(FIRST_BOX, min(FIRST_WALL, FIRST_BOX + len(pair.scene.boxes))):
        box = labels == label if told is None else (labels == label) & told
        if box.any():
            tally.boxes += 1
            if frame.mask[box].mean() > BOX_FREE:
                tally.boxes_merged += 1
                tally.misses.append(f"{name}: BOX {label} is free ({frame.note})")
    for label in marks:
        mark = labels == label
        tally.marks += 1
        if frame.mask[mark].mean() >= MARK_FREE:
            tally.marks_merged += 1
        else:
            tally.misses.append(f"{name}: mark {label} of {mark.sum()} px stayed ({frame.note})")


def overlap(mask: NDArray[np.bool_], truth: NDArray[np.bool_], known: NDArray[np.bool_] | None = None) -> float:
    """IoU over the pixels that are known."""
    levels = np.where(truth, np.uint8(INSIDE), np.uint8(0))
    return iou(mask, levels if known is None else np.where(known, levels, np.uint8(IGNORED)))


def measure(pair: RenderedPair, frame: Frame, tally: Tally, name: str) -> None:
    """Add one pair to the tally."""
    count_things(pair, enclosed_marks(pair), frame, tally, name)
    tally.ious.append(overlap(frame.mask, pair.current.truth))
    if frame.motion is not None:
        true = relative_motion(*true_poses(pair))
        error = np.linalg.norm(frame.motion.translation - true.translation) / true.baseline
        tally.shift_errors.append(float(error))


def true_poses(pair: RenderedPair) -> tuple[Pose, Pose]:
    """Poses the pair was rendered from."""
    return planar_pose(pair.camera, *pair.poses[0]), planar_pose(pair.camera, *pair.poses[1])


def poses_of(pair: RenderedPair, mode: str, seed: int) -> tuple[Pose, Pose] | None:
    """Poses for a mode; noise is put on the previous one."""
    if mode == "none":
        return None
    previous, current = true_poses(pair)
    if mode == "poses":
        return previous, current
    random = np.random.default_rng([seed, 9])
    x, y, theta = pair.poses[0]
    spread = NOISE_METRES * np.hypot(x, y)
    dx, dy = random.normal(0, spread, 2)
    return planar_pose(pair.camera, x + dx, y + dy, theta + random.normal(0, NOISE_RADIANS)), current


def run(seeds: range, params: Parameters, modes: tuple[str, ...] = MODES) -> dict[str, Tally]:
    """Render, segment and test every pair in every mode."""
    tallies = {mode: Tally() for mode in modes}
    for seed in seeds:
        pair = render_pair(seed)
        segmentation = segment_view(pair.current.image, pair.camera, params)
        for mode in modes:
            frame = free_space(
                pair.current.image, segmentation, pair.previous.image, pair.camera,
                params.obstacles.altitude, poses_of(pair, mode, seed),
            )  # fmt: skip
            measure(pair, frame, tallies[mode], f"pair {seed}")
    return tallies


def snakes(seeds: range) -> dict[str, Tally]:
    """The snake on an image alone, which leaves out its altitude term, and on pairs with exact poses."""
    params, tallies = load_params(None, {"method": "snake"}), {"alone": Tally(), "pair": Tally()}
    for seed in seeds:
        pair = render_pair(seed)
        before, now = true_poses(pair)
        both = Sequence(pair.camera, params)
        both.feed(pair.previous.image, before)
        for name, sequence in (("alone", Sequence(pair.camera, params)), ("pair", both)):
            measure(pair, sequence.feed(pair.current.image, now), tallies[name], f"pair {seed}")
    return tallies


FIGURES = "boxes merged | marks merged | mean IoU"


def figures(tally: Tally) -> str:
    """The columns of ``FIGURES``."""
    marks = f"{tally.marks_merged} of {tally.marks} ({tally.marks_merged / max(1, tally.marks):.1%})"
    return f"{tally.boxes_merged} of {tally.boxes} | {marks} | {np.mean(tally.ious):.4f} (min {min(tally.ious):.4f})"


def table(tallies: dict[str, Tally]) -> str:
    """The figures as Markdown."""
    lines = [f"| mode | {FIGURES} | translation error max / mean |", "| --- | --- | --- | --- | --- |"]
    for mode, tally in tallies.items():
        errors = tally.shift_errors or [float("nan")]
        lines.append(f"| {mode} | {figures(tally)} | {max(errors):.2%} / {np.mean(errors):.2%} |")
    return "\n".join(lines)


def main(pairs: int = 50, first: int = 0, snake: bool = False) -> int:
    """Run the campaign and say whether its promises hold."""
    seeds = range(first, first + pairs)
    if snake:
        print(table(snakes(seeds)))
        return 0
    tallies = run(seeds, load_params())
    print(table(tallies))
    for mode, tally in tallies.items():
        for miss in tally.misses:
            print(f"{mode}: {miss}")
    least = {"poses": 0.95, "noisy": 0.90, "none": 0.85}
    kept = all(t.boxes_merged == 0 and t.marks_merged >= least[mode] * t.marks for mode, t in tallies.items())
    kept &= float(np.mean(tallies["poses"].ious)) >= 0.985 and max(tallies["none"].shift_errors) <= 0.05
    return 0 if kept else 1


if __name__ == "__main__":
    harness.as_command(main)
