"""Paint or obstacle on floors of every kind; run ``python -m tests.campaigns.floors``.

Floors with a texture of 0 to 5 grey levels under noise of 1 to 4, glossy ones, shadows of boxes, cameras that nod or
turn, marks without corners or touching each other, walls and boxes of the floor's own grey in places: each with exact
poses, with poses off by 2 % and 0.5 degrees, and without poses. Says for every kind and mode the boxes merged (there must
be none), the enclosed marks merged and the mean IoU of the free space. Reflections and shadows, which are ground that no
pair shows to be ground, are left out of the IoU. Of boxes with squares of the floor's grey (``alike``) what lies within
RING pixels of their border is left out of the judgement whether they are entered: nothing tells a square there from
floor. The kind ``alike`` is what ``--footprint`` is for.
"""

import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ffseg.freespace.sequence import Frame, segment_frame
from ffseg.freespace.window import Earlier
from ffseg.parameters import Parameters, load_params
from ffseg.rendering import FLOOR_KINDS, RenderedPair, floor_pair
from ffseg.rendering.floors import NOISES, TEXTURES, FloorKind
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL, GROUND, SHADOW, STREAK
from ffseg.scene import Scene
from tests.campaigns import harness
from tests.campaigns.freespace import FIGURES, MODES, Tally, count_things, figures, overlap, poses_of, ring

LEAST = {"poses": 0.95, "noisy": 0.95, "none": 0.90}
"""Marks merged, of those enclosed; without poses where the scene holds ``MARKS_WITHOUT_POSES`` or more."""
LEAST_IOU = 0.985
MARKS_WITHOUT_POSES = 4

Tallies = dict[tuple[str, str], Tally]


@dataclass(frozen=True)
class Case:
    """One pair to be judged."""

    seed: int
    kind: FloorKind
    texture: float
    noise: float

    def name(self) -> str:
        """What the table groups by."""
        return f"texture {self.texture:g}" if self.kind == "plain" else self.kind


def cases(pairs: int, kinds: tuple[str, ...], first: int = 0) -> Iterator[Case]:
    """So many pairs of every kind, and of every texture of the plain one; noises and textures come in turn."""
    for kind in (kind for kind in FLOOR_KINDS if kind in kinds):
        place = FLOOR_KINDS.index(kind)
        textures = TEXTURES if kind == "plain" else (None,)
        for row, texture in enumerate(textures):
            for index in range(first, first + pairs):
                own = TEXTURES[index % len(TEXTURES)] if texture is None else texture
                noise = NOISES[(index // (len(TEXTURES) if texture is None else 1)) % len(NOISES)]
                yield Case(100_000 * place + 10_000 * row + index, kind, own, noise)


def rendered(case: Case, cache: Path | None = None) -> RenderedPair:
    """The pair of a case; from the cache where it has it."""
    if cache is None:
        return floor_pair(case.seed, case.kind, case.texture, case.noise)
    path = cache / f"{case.seed}.pickle"
    if not path.is_file():
        cache.mkdir(parents=True, exist_ok=True)
        path.write_bytes(pickle.dumps(rendered(case)))
    pair: RenderedPair = pickle.loads(path.read_bytes())
    return pair


def enclosed_marks(pair: RenderedPair) -> list[int]:
    """Labels of marks with ground or other marks all round them."""
    labels, last = pair.current.labels, len(pair.scene.marks)
    found = []
    for label in range(1, last + 1):
        mark = labels == label
        around = labels[ring(mark)] if mark.any() else np.array([FIRST_WALL])
        if np.all((around >= GROUND) & (around <= last)):
            found.append(label)
    return found


def is_alike(pair: RenderedPair) -> bool:
    """Whether the boxes have squares of the floor's grey, which at their border nothing tells from floor."""
    return any(box.squares is not None for box in pair.scene.boxes)


def inner_boxes(pair: RenderedPair) -> NDArray[np.bool_]:
    """Pixels of boxes farther than ``RING`` from their border."""
    boxes = (pair.current.labels >= FIRST_BOX) & (pair.current.labels < FIRST_WALL)
    return boxes & ~ring(~boxes)


def measure(pair: RenderedPair, frame: Frame, tally: Tally, name: str) -> None:
    """Add one pair to the tally."""
    count_things(pair, enclosed_marks(pair), frame, tally, name, inner_boxes(pair) if is_alike(pair) else None)
    known = ~np.isin(pair.current.labels, (STREAK, SHADOW))
    tally.ious.append(overlap(frame.mask, pair.current.truth, known))


def run(chosen: Iterator[Case], params: Parameters, cache: Path | None = None, footprint: float = 0.0) -> Tallies:
    """Render, segment and test every case in every mode; tallies by name and mode."""
    tallies: Tallies = {}
    for case in chosen:
        pair = rendered(case, cache)
        pair = replace(pair, camera=replace(pair.camera, footprint=footprint))
        for mode in MODES:
            if mode == "none" and len(pair.scene.marks) < MARKS_WITHOUT_POSES:
                continue
            poses = poses_of(pair, mode, case.seed)
            frame = segment_frame(Scene(pair.current.image, params), [Earlier(pair.previous.image, poses)], pair.camera)
            name = f"{case.name()} (texture {case.texture:g}, noise {case.noise:g}), {mode}, seed {case.seed}"
            measure(pair, frame, tallies.setdefault((case.name(), mode), Tally()), name)
    return tallies


def table(tallies: dict[tuple[str, str], Tally]) -> str:
    """The figures as Markdown."""
    lines = [f"| floor | mode | {FIGURES} |", "| --- | --- | --- | --- | --- |"]
    lines += [f"| {name} | {mode} | {figures(tally)} |" for (name, mode), tally in tallies.items()]
    return "\n".join(lines)


def kept(tallies: dict[tuple[str, str], Tally]) -> bool:
    """Whether every kind in every mode keeps its promise."""
    return all(
        tally.boxes_merged == 0 and tally.marks_merged >= LEAST[mode] * tally.marks and np.mean(tally.ious) >= LEAST_IOU
        for (_, mode), tally in tallies.items()
    )


def main(pairs: int = 15, first: int = 0, kinds: str = "", cache: Path | None = None, footprint: float = 0.0) -> int:
    """Run the campaign and say whether its promises hold."""
    every = FLOOR_KINDS if footprint else tuple(kind for kind in FLOOR_KINDS if kind != "alike")
    chosen = cases(pairs, tuple(kinds.split(",")) if kinds else every, first)
    tallies = run(chosen, load_params(), cache, footprint)
    print(table(tallies))
    for tally in tallies.values():
        for miss in tally.misses:
            print(miss)
    return 0 if kept(tallies) else 1


if __name__ == "__main__":
    harness.as_command(main)
