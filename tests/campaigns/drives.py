"""Maps of rendered drives against their worlds; run ``python -m tests.campaigns.drives``.

Drives of 20 frames are fused with exact poses, with odometry off by 2 % and half a degree a step, and without poses: of the
cells that are said to be free with a probability, how many are (each tenth of it, and .85 to .95), the IoU of free cells in the
grid, free cells in boxes (within 3 cm of a box's outline none counts), and by how many of its own standard deviations the last
station is off. ``--frames 1`` looks at single frames; with ``--nod 3`` the camera leans by up to 3 degrees at each of them.
``--cost`` says what the ground, the scan and the fusing of a frame take beside its edge map, in processor time on one thread, all
in turn.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import shapely

from ffseg.camera.motion import planar_pose
from ffseg.freespace.occupancy import OccupancyMap
from ffseg.freespace.sequence import Sequence
from ffseg.image.edges import edge_map
from ffseg.parameter_files import load_params
from ffseg.rendering.pairs import RenderedSequence, sample_camera
from tests.campaigns import harness
from tests.floors import NOISES, TEXTURES, floor_sequence
from tests.worlds import footprint, free_ground

FIRST = 730_000
"""Seed of the first drive; constants of the map were chosen on 720000 to 720019, and 721000 to 721011 that nod."""
PROMISE, OFF = 3.0, 0.05
"""Most edge maps that a frame takes; most that a tenth of the probabilities may be off by."""
ODOMETRY = np.array([0.02, 0.02, np.deg2rad(0.5)])


def odometry(poses: np.ndarray, seed: int) -> np.ndarray:
    """Poses whose steps are off by 2 % of their length, and by half a degree."""
    random, found = np.random.default_rng([seed, 77]), [poses[0]]
    for before, now in itertools.pairwise(poses):
        step, (c, s) = now - before, np.array([np.cos(found[-1][2] - before[2]), np.sin(found[-1][2] - before[2])])
        scale = np.array([np.hypot(*step[:2])] * 2 + [1.0])
        bent = np.array([c * step[0] - s * step[1], s * step[0] + c * step[1], step[2]])
        found.append(found[-1] + bent + random.normal(0.0, ODOMETRY) * scale)
    return np.array(found)


def fused(sight: RenderedSequence, poses: np.ndarray | None) -> OccupancyMap:
    """The map of a drive with these poses."""
    camera = replace(sample_camera(), footprint=0.15)
    sequence, grid = Sequence(camera, mapped=True), OccupancyMap()
    for number, view in enumerate(sight.views):
        where = None if poses is None else planar_pose(camera, *poses[number].tolist())
        grid.add(sequence.feed(view.image, where), where)
    return grid


def judged(
    grid: OccupancyMap, sight: RenderedSequence, frame: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probability of the known cells to be free, whether they are, and whether they lie in a box.

    ``frame`` is the pose of the map's frame in the world.
    """
    chance, (c, s) = grid.probability, (np.cos(frame[2]), np.sin(frame[2]))
    x, y = np.meshgrid(*(np.arange(side) + 0.5 for side in chance.shape[::-1]))
    places = np.stack([x, y], axis=-1)[chance != 0.5] * grid.cell + np.array(grid.origin)
    places = places @ np.array([[c, s], [-s, c]]) + frame[:2]
    deep = shapely.union_all([footprint(box).buffer(-0.03) for box in sight.scene.boxes])
    free, boxed = (shapely.contains_xy(one, *places.T) for one in (free_ground(sight.scene), deep))
    return 1.0 - chance[chance != 0.5], free, boxed


def strayed(grid: OccupancyMap, sight: RenderedSequence, frame: tuple[float, float, float]) -> float:
    """By how many of its standard deviations, to each side, the last station is off; NaN where none is."""
    last, (c, s) = grid.stations[-1], (np.cos(frame[2]), np.sin(frame[2]))
    if last is None or last.sigma_m == 0.0:
        return float("nan")
    place = np.array([c * last.x - s * last.y, s * last.x + c * last.y]) + frame[:2]
    return float(np.hypot(*(place - sight.poses[-1][:2])) / last.sigma_m / np.sqrt(2.0))


def reliability(count: int, frames: int, nod: float) -> bool:
    """Print the table of all drives; whether it is as promised."""
    found: dict[str, list[tuple[np.ndarray, ...]]] = {"exact": [], "off": [], "none": []}
    strays: dict[str, list[float]] = {how: [] for how in found}
    for index in range(count):
        sight = floor_sequence(FIRST + index, frames, TEXTURES[index % 5], NOISES[index % 3], np.deg2rad(nod))
        true = np.array(sight.poses)
        for how, poses in (("exact", true), ("off", odometry(true, index)), ("none", None)):
            grid, frame = fused(sight, poses), sight.poses[0] if poses is None else (0.0, 0.0, 0.0)
            found[how].append(judged(grid, sight, frame))
            strays[how].append(strayed(grid, sight, frame))
    columns = [*(f"{k / 10:.1f} to {(k + 1) / 10:.1f}" for k in range(10)), "of .85 to .95"]
    columns += ["IoU: mean, least", "in boxes", "strays (rms)"]
    print("| poses | " + " | ".join(columns) + " |\n| --- |" + " --- |" * len(columns))
    good = True
    for how, drives in found.items():
        said, free, boxed = (np.concatenate(one) for one in zip(*drives, strict=True))
        tenth = np.minimum((said * 10).astype(int), 9)
        pairs = [(said[tenth == k].mean(), free[tenth == k].mean(), np.count_nonzero(tenth == k)) for k in range(10)]
        overlaps = [((one > 0.75) & two).sum() / ((one > 0.75) | two).sum() for one, two, _ in drives]
        wrong, nine = np.count_nonzero(boxed & (said > 0.75)), free[(said > 0.85) & (said < 0.95)].mean()
        cells = " | ".join(f"{a:.2f}: {b:.2f} ({n})" for a, b, n in pairs)
        figures = f"{nine:.3f} | {np.mean(overlaps):.4f}, {min(overlaps):.4f} | {wrong}"
        print(f"| {how} | {cells} | {figures} | {np.sqrt(np.nanmean(np.square(strays[how]))):.2f} |", flush=True)
        good &= all(abs(a - b) <= OFF for a, b, _ in pairs) and min(overlaps) >= 0.98 and not wrong
    return good


def costs(rounds: int = 25) -> bool:
    """Print what the steps of a frame take; whether they keep the promise."""
    cv2.setNumThreads(1)
    camera, params = replace(sample_camera(), footprint=0.15), load_params()
    sight = floor_sequence(FIRST, 3, 2.0, 1.0)
    poses = [planar_pose(camera, *pose) for pose in sight.poses]
    sequence = Sequence(camera, mapped=True)
    frames = [sequence.feed(view.image, pose) for view, pose in zip(sight.views, poses, strict=True)]
    frame, grids = frames[2], [OccupancyMap() for _ in range(rounds)]
    for grid in grids:
        for before, pose in zip(frames[:2], poses[:2], strict=True):
            grid.add(before, pose)  # the frame's motion is since these
    begun = iter(grids)
    domain, ground = np.where(camera.domain(), np.uint8(255), np.uint8(0)), frame.ground()
    steps: dict[str, Callable[[], object]] = {
        "edge map": lambda: edge_map(sight.views[2].image, params.edges, domain),
        "ground": frame.ground,
        "scan": ground.scan,
        "fusing": lambda: next(begun).add(frame, poses[2]),
    }
    times = np.array([[harness.milliseconds(step) for step in steps.values()] for _ in range(rounds)])
    middle = np.median(times, axis=0) / np.median(times[:, 0])
    print(", ".join(f"{name} {one:.2f}" for name, one in zip(steps, middle, strict=True)))
    print(f"{middle[1:].sum():.2f} edge maps a frame")
    return bool(middle[1:].sum() <= PROMISE)


def main(drives: int = 12, frames: int = 20, nod: float = 0.0, cost: bool = False) -> int:
    """Run what is asked for; 1 when a promise is not kept."""
    return int(not (costs() if cost else reliability(drives, frames, nod)))


if __name__ == "__main__":
    harness.as_command(main)
