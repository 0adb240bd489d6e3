"""What a pair costs beside its edge map; run ``python -m tests.campaigns.pair_times``.

Over rendered pairs: the test alone (components, points, matching, triangulation, verdict) and motion with test, with
poses and without. Every round times all of them and the edge map in turn, in processor time on one thread, so that a
busy machine slows them alike; what is said are ratios of medians.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import cv2
import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose
from ffseg.freespace.pairs import ImagePair
from ffseg.freespace.sequence import free_space, segment_view
from ffseg.freespace.structural import structural_test
from ffseg.image.components import contour_components
from ffseg.image.edges import edge_map
from ffseg.parameters import Parameters, load_params
from ffseg.rendering import render_pair
from tests.campaigns.freespace import true_poses

Image = NDArray[np.uint8]

ROOT = Path(__file__).resolve().parents[2]
STEPS = ("components", "test", "motion and test, poses", "motion and test, no poses")
PROMISE = 2.0
"""The test takes at most so many times the edge map's time."""


@dataclass(frozen=True)
class Case:
    """One pair of images to be timed."""

    current: Image
    previous: Image
    camera: Camera
    poses: tuple[Pose, Pose]
    params: Parameters


def ratios(case: Case, rounds: int) -> tuple[float, list[float], int]:
    """Median time of the edge map, ms, of each of ``STEPS`` in its units (NaN without a motion), and components."""
    epsilon = case.params.obstacles.altitude
    found = segment_view(case.current, case.camera, case.params)
    frame = free_space(case.current, found, case.previous, case.camera, epsilon, case.poses)
    domain = np.where(case.camera.domain(), np.uint8(255), np.uint8(0))

    _, components = contour_components(found.contours, frame.mask.shape)

    def test() -> None:
        if frame.motion is not None:
            seen = ImagePair(case.current, case.previous, frame.camera or case.camera, frame.motion)
            structural_test(seen, components, epsilon, frame.fit)

    steps: list[Callable[[], object]] = [
        lambda: edge_map(case.current, case.params.edges, domain),
        lambda: contour_components(found.contours, frame.mask.shape),  # of every image, whether it has a pair or not
        test,
        lambda: free_space(case.current, found, case.previous, case.camera, epsilon, case.poses),
        lambda: free_space(case.current, found, case.previous, case.camera, epsilon),
    ]
    times = np.array([[_milliseconds(step) for step in steps] for _ in range(rounds)])
    edges, *others = np.median(times, axis=0)
    if frame.motion is None or not frame.components:
        others[1] = float("nan")
    return float(edges), [float(other / edges) for other in others], len(frame.components)


def _milliseconds(step: Callable[[], object]) -> float:
    begin = process_time()
    step()
    return (process_time() - begin) * 1e3


def table(rows: list[list[float]]) -> str:
    """Median, ninth decile and largest ratio of every step as Markdown."""
    lines = ["| step / edge map | median | 90 % | largest |", "| --- | --- | --- | --- |"]
    for name, column in zip(STEPS, np.array(rows).T, strict=True):
        own = column[np.isfinite(column)]
        if len(own):
            lines.append(f"| {name} | {np.median(own):.2f} | {np.quantile(own, 0.9):.2f} | {own.max():.2f} |")
    return "\n".join(lines)


def main() -> int:
    """Print the ratios; 1 when the test takes more than it promises."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    params, measured = load_params(), []
    for seed in range(options.pairs):
        pair = render_pair(seed)
        case = Case(pair.current.image, pair.previous.image, pair.camera, true_poses(pair), params)
        measured.append(ratios(case, options.rounds))
    rows = [row for _, row, _ in measured]
    edges, components = (np.median([entry[place] for entry in measured]) for place in (0, 2))
    print(f"edge map {edges:.2f} ms, {components:.0f} components\n{table(rows)}")
    kept = np.nanmedian([row[STEPS.index("test")] for row in rows]) <= PROMISE
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
