"""The snake's altitude term (Eq. 11) on rendered pairs: run ``python -m tests.campaigns.snake_pairs --first 31 --pairs 20``.

Says how many marks and boxes the snake entered, and the mean IoU of the free space, without the term and with it.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, field
from statistics import mean

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.motion import planar_pose
from ffseg.freespace.sequence import Sequence, segment_view
from ffseg.parameters import load_params
from ffseg.rendering import RenderedPair, render_pair
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL

MARK_FREE, BOX_FREE = 0.9, 0.1
"""Share of a mark's pixels that must be free for it to be passed, and of a box's for it to be entered."""
LEAST_AREA = 20
"""Pixels; less of a thing is all border."""


@dataclass
class Tally:
    """Counts over pairs."""

    marks: int = 0
    marks_passed: int = 0
    boxes: int = 0
    boxes_entered: int = 0
    ious: list[float] = field(default_factory=list)

    def add(self, pair: RenderedPair, mask: NDArray[np.bool_]) -> None:
        """Count one image."""
        labels, truth = pair.current.labels, pair.current.truth
        marks = _shares(mask, labels, range(1, len(pair.scene.marks) + 1))
        boxes = _shares(mask, labels, range(FIRST_BOX, FIRST_WALL))
        self.marks += len(marks)
        self.marks_passed += sum(share > MARK_FREE for share in marks)
        self.boxes += len(boxes)
        self.boxes_entered += sum(share > BOX_FREE for share in boxes)
        self.ious.append(float((mask & truth).sum() / (mask | truth).sum()))


def _shares(mask: NDArray[np.bool_], labels: NDArray[np.integer], of: range) -> list[float]:
    return [float(mask[labels == one].mean()) for one in of if (labels == one).sum() > LEAST_AREA]


def run(first: int, pairs: int) -> dict[str, Tally]:
    """Tallies without the term and with it."""
    params = load_params(None, {"method": "snake"})
    tallies = {"without": Tally(), "with": Tally()}
    for seed in range(first, first + pairs):
        pair = render_pair(seed)
        tallies["without"].add(pair, segment_view(pair.current.image, pair.camera, params).mask)
        sequence = Sequence(pair.camera, params)
        before, now = (planar_pose(pair.camera, *pose) for pose in pair.poses)
        sequence.feed(pair.previous.image, before)
        tallies["with"].add(pair, sequence.feed(pair.current.image, now).mask)
    return tallies


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--first", type=int, default=31, help="seed of the first pair")
    parser.add_argument("--pairs", type=int, default=20)
    options = parser.parse_args()
    for name, tally in run(options.first, options.pairs).items():
        sys.stdout.write(
            f"{name:8} marks passed {tally.marks_passed}/{tally.marks}, boxes entered {tally.boxes_entered}/"
            f"{tally.boxes}, mean IoU {mean(tally.ious):.4f}\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
