"""Verdicts along sequences of a driving robot; run ``python -m tests.campaigns.sequences``.

Of a mark that is merged in one frame: in how many of the later frames in which it is enclosed and larger than 150 pixels
it is merged as well (90 % are promised in every sequence), by a `Sequence` and by images judged one by one, as a batch
does; the marks' shares of all frames; the boxes merged (there must be none); and how often a mark changes its number.
"""

from dataclasses import dataclass, field

import numpy as np

from ffseg.camera.motion import Pose, planar_pose
from ffseg.freespace.sequence import Frame, Sequence, free_space, segment_view
from ffseg.freespace.window import WINDOW, Earlier
from ffseg.parameters import Parameters, load_params
from ffseg.rendering import floor_sequence, sample_camera
from ffseg.rendering.floors import NOISES, TEXTURES, FloorSequence
from ffseg.rendering.raycast import FIRST_BOX, FIRST_WALL, GROUND
from tests.campaigns import harness
from tests.campaigns.freespace import BOX_FREE, MARK_FREE, ring

LARGE = 150
"""Pixels of a mark for it to count."""
LEAST = 0.9


@dataclass
class Story:
    """What became of one mark."""

    merged: list[bool] = field(default_factory=list)
    numbers: set[int] = field(default_factory=set)

    def kept(self) -> tuple[int, int]:
        """Frames after the first merged one in which it was merged too, and all of them."""
        if True not in self.merged:
            return 0, 0
        later = self.merged[self.merged.index(True) + 1 :]
        return sum(later), len(later)


@dataclass
class Outcome:
    """What became of a sequence."""

    stories: dict[int, Story] = field(default_factory=dict)
    boxes_merged: int = 0
    boxes: int = 0

    def kept(self) -> tuple[int, int]:
        """Frames of all marks, as `Story.kept`."""
        pairs = [story.kept() for story in self.stories.values()]
        return sum(pair[0] for pair in pairs), sum(pair[1] for pair in pairs)


def frames(drive: FloorSequence, params: Parameters, poses: list[Pose | None], *, alone: bool) -> list[Frame]:
    """The frames of a drive, by a `Sequence` or each alone with the window before it."""
    camera = sample_camera()
    if not alone:
        sequence = Sequence(camera, params)
        return [sequence.feed(view.image, pose) for view, pose in zip(drive.views, poses, strict=True)]
    found = []
    for index, view in enumerate(drive.views):
        window = range(index - 1, max(-1, index - 1 - WINDOW), -1)
        now = poses[index]
        earlier = [
            Earlier(drive.views[k].image, (before, now) if before is not None and now is not None else None, str(k))
            for k, before in ((k, poses[k]) for k in window)
        ]
        segmentation = segment_view(view.image, camera, params)
        found.append(free_space(view.image, segmentation, None, camera, params.obstacles.altitude, earlier=earlier))
    return found


def outcome(drive: FloorSequence, found: list[Frame]) -> Outcome:
    """Marks and boxes of a drive."""
    result = Outcome()
    last = len(drive.scene.marks)
    for view, frame in zip(drive.views, found, strict=True):
        labels = view.labels
        for label in range(FIRST_BOX, min(FIRST_WALL, FIRST_BOX + len(drive.scene.boxes))):
            box = labels == label
            if box.any():
                result.boxes += 1
                result.boxes_merged += bool(frame.mask[box].mean() > BOX_FREE)
        for label in range(1, last + 1):
            mark = labels == label
            if mark.sum() > LARGE and np.all((labels[ring(mark)] >= GROUND) & (labels[ring(mark)] <= last)):
                story = result.stories.setdefault(label, Story())
                story.merged.append(bool(frame.mask[mark].mean() >= MARK_FREE))
                story.numbers |= {
                    row.track for row in frame.components if mark[round(row.centroid_y), round(row.centroid_x)]
                }
    return result


def main(sequences: int = 6, frames: int = 20, first: int = 0) -> int:
    """Run the campaign and say whether its promise holds."""
    params, good = load_params(), True
    print("| sequence | texture, noise | how | kept | merged of all | boxes merged | numbers per mark |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for index in range(first, first + sequences):
        texture, noise = TEXTURES[index % 5], NOISES[index % 3]
        drive = floor_sequence(900_000 + index, frames, texture, noise)
        exact: list[Pose | None] = [planar_pose(sample_camera(), *pose) for pose in drive.poses]
        for name, poses, alone in (
            ("Sequence, poses", exact, False),
            ("alone, poses", exact, True),
            ("Sequence, no poses", [None] * len(exact), False),
        ):
            result = outcome(drive, frames(drive, params, poses, alone=alone))
            kept, later = result.kept()
            merged = [one for story in result.stories.values() for one in story.merged]
            numbers = max((len(story.numbers) for story in result.stories.values()), default=0)
            good &= result.boxes_merged == 0 and kept >= LEAST * later
            print(
                f"| {index} | {texture:g}, {noise:g} | {name} | {kept} of {later} | {sum(merged)} of {len(merged)} | "
                f"{result.boxes_merged} of {result.boxes} | {numbers} |",
                flush=True,
            )
    return 0 if good else 1


if __name__ == "__main__":
    harness.as_command(main)
