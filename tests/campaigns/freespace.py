"""Free space on rendered pairs, paint or obstacle: ``python -m tests.campaigns.freespace [--kinds floors|KIND,...]``.

Drawn pairs (the kind ``drawn``, else alone) and ``floors`` of every kind: with a texture of 0 to 5 grey levels under noise of 1
to 4, glossy ones, shadows of boxes, cameras that nod or turn, marks without corners or touching each other, walls and boxes of
the floor's own grey in places: each with exact poses, with poses off by 2 % and 0.5 degrees, and without poses. Says for every
kind and mode the boxes merged (there must be none), the enclosed marks merged, the mean IoU of the free space, and the
translation error of the motion. Reflections and shadows, which are ground that no pair shows to be ground, are left out of the
IoU. Of boxes with squares of the floor's grey (``alike``, what ``--footprint`` is for) what lies within RING pixels of their
border is left out of the judgement whether they are entered: nothing tells a square there from floor.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.motion import Pose, planar_pose, relative_motion
from ffseg.freespace.sequence import Frame, segment_frame
from ffseg.freespace.window import EarlierImage
from ffseg.metrics import IGNORED, INSIDE, iou
from ffseg.parameter_files import load_params
from ffseg.parameters import Parameters
from ffseg.rendering.pairs import RenderedPair, render_pair
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL, GROUND, SHADOW, STREAK
from ffseg.scene import Scene
from tests.campaigns import harness
from tests.floors import FLOOR_KINDS, NOISES, TEXTURES, FloorKind, floor_pair

MODES = ("poses", "noisy", "none")
NOISE_METRES, NOISE_RADIANS = 0.02, np.deg2rad(0.5)
"""Of the pose noise: relative to the baseline per axis, and absolute."""
MARK_FREE = 0.9
"""Share of a mark's pixels that must be free; its border pixels are mixed."""
BOX_FREE = 0.05
"""Share of a box's pixels that may be free; its border pixels are mixed."""
RING = 6
"""Pixels of plain ground round a mark for it to count as enclosed: the contour needs room to pass."""


LEAST = {"poses": 0.95, "noisy": 0.95, "none": 0.90}
"""Marks merged, of those enclosed; without poses where the scene holds ``MARKS_WITHOUT_POSES`` or more."""
LEAST_IOU = 0.985
MARKS_WITHOUT_POSES = 4
MOST_SHIFTED = 0.05
"""Error of the translation of drawn pairs without poses, relative."""


@dataclass
class Tally:
    boxes: int = 0
    boxes_merged: int = 0
    marks: int = 0
    marks_merged: int = 0
    ious: list[float] = field(default_factory=list)
    shift_errors: list[float] = field(default_factory=list)
    misses: list[str] = field(default_factory=list)


Tallies = dict[tuple[str, str], Tally]


@dataclass(frozen=True)
class Case:
    """One pair to be judged; a drawn one has the texture and noise of its seed."""

    seed: int
    kind: FloorKind | Literal["drawn"]
    texture: float = np.nan
    noise: float = np.nan

    def name(self) -> str:
        return f"texture {self.texture:g}" if self.kind == "plain" else self.kind


def cases(pairs: int, kinds: tuple[str, ...], first: int = 0) -> Iterator[Case]:
    """So many pairs of every kind, and of every texture of the plain one; noises and textures come in turn."""
    numbers = range(first, first + pairs)
    yield from (Case(seed, "drawn") for seed in numbers if "drawn" in kinds)
    for place, kind in enumerate(FLOOR_KINDS):
        if kind == "plain" and kind in kinds:
            for (row, texture), index in product(enumerate(TEXTURES), numbers):
                yield Case(100_000 * place + 10_000 * row + index, kind, texture, NOISES[index % len(NOISES)])
        elif kind in kinds:
            for index in numbers:
                turn, texture = divmod(index, len(TEXTURES))
                yield Case(100_000 * place + index, kind, TEXTURES[texture], NOISES[turn % len(NOISES)])


def rendered(case: Case) -> RenderedPair:
    if case.kind == "drawn":
        return render_pair(case.seed)
    return floor_pair(case.seed, case.kind, case.texture, case.noise)


def enclosed_marks(pair: RenderedPair) -> list[int]:
    """Labels of marks with ground or other marks all round them."""
    labels, last = pair.current.labels, len(pair.scene.marks)
    allowed = (labels >= GROUND) & (labels <= last)
    return [label for label in range(1, last + 1) if (labels == label).any() and allowed[ring(labels == label)].all()]


def ring(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The mask grown by ``RING`` pixels."""
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * RING + 1,) * 2, np.uint8)) > 0


def is_alike(pair: RenderedPair) -> bool:
    """Whether the boxes have squares of the floor's grey, which at their border nothing tells from floor."""
    return any(box.squares is not None for box in pair.scene.boxes)


def inner_boxes(pair: RenderedPair) -> NDArray[np.bool_]:
    """Pixels of boxes farther than ``RING`` from their border."""
    boxes = (pair.current.labels >= FIRST_BOX) & (pair.current.labels < FIRST_WALL)
    return boxes & ~ring(~boxes)


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
    levels = np.where(truth, np.uint8(INSIDE), np.uint8(0))
    return iou(mask, levels if known is None else np.where(known, levels, np.uint8(IGNORED)))


def measure(pair: RenderedPair, frame: Frame, tally: Tally, name: str) -> None:
    count_things(pair, enclosed_marks(pair), frame, tally, name, inner_boxes(pair) if is_alike(pair) else None)
    known = ~np.isin(pair.current.labels, (STREAK, SHADOW))
    tally.ious.append(overlap(frame.mask, pair.current.truth, known))
    if frame.motion is not None:
        true = relative_motion(*true_poses(pair))
        error = np.linalg.norm(frame.motion.translation - true.translation) / true.baseline
        tally.shift_errors.append(float(error))


def true_poses(pair: RenderedPair) -> tuple[Pose, Pose]:
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


def run(chosen: Iterator[Case], params: Parameters, footprint: float = 0.0) -> Tallies:
    """Render, segment and test every case in every mode; tallies by name and mode."""
    tallies: Tallies = {}
    for case in chosen:
        pair = rendered(case)
        pair = replace(pair, camera=replace(pair.camera, footprint=footprint))
        for mode in MODES:
            if case.kind != "drawn" and mode == "none" and len(pair.scene.marks) < MARKS_WITHOUT_POSES:
                continue
            poses = poses_of(pair, mode, case.seed)
            frame = segment_frame(
                Scene(pair.current.image, params), [EarlierImage(pair.previous.image, poses)], pair.camera
            )
            name = f"{case.name()} (texture {case.texture:g}, noise {case.noise:g}), {mode}, seed {case.seed}"
            measure(pair, frame, tallies.setdefault((case.name(), mode), Tally()), name)
    return tallies


def table(tallies: Tallies) -> str:
    """The figures as Markdown."""
    lines = [
        "| floor | mode | boxes merged | marks merged | mean IoU | translation error max / mean |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for (name, mode), tally in tallies.items():
        marks = f"{tally.marks_merged} of {tally.marks} ({tally.marks_merged / max(1, tally.marks):.1%})"
        ious, errors = f"{np.mean(tally.ious):.4f} (min {min(tally.ious):.4f})", tally.shift_errors or [np.nan]
        boxes, shifts = f"{tally.boxes_merged} of {tally.boxes}", f"{max(errors):.2%} / {np.mean(errors):.2%}"
        lines.append(f"| {name} | {mode} | {boxes} | {marks} | {ious} | {shifts} |")
    return "\n".join(lines)


def kept(tallies: Tallies) -> bool:
    """Whether every kind in every mode keeps its promise."""
    if max(tallies.get(("drawn", "none"), Tally()).shift_errors, default=0.0) > MOST_SHIFTED:
        return False
    return all(
        tally.boxes_merged == 0 and tally.marks_merged >= LEAST[mode] * tally.marks and np.mean(tally.ious) >= LEAST_IOU
        for (_, mode), tally in tallies.items()
    )


def main(pairs: int = 15, first: int = 0, kinds: str = "drawn", footprint: float = 0.0) -> int:
    """Run the campaign and say whether its promises hold."""
    every = FLOOR_KINDS if footprint else tuple(kind for kind in FLOOR_KINDS if kind != "alike")
    chosen = cases(pairs, every if kinds == "floors" else tuple(kinds.split(",")), first)
    tallies = run(chosen, load_params(), footprint)
    print(table(tallies), *(miss for tally in tallies.values() for miss in tally.misses), sep="\n")
    return 0 if kept(tallies) else 1


if __name__ == "__main__":
    harness.as_command(main)
