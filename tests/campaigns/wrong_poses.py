"""Poses in wrong units, signs or order: each is to be named, and no component judged; ``python -m tests.campaigns.wrong_poses``.

A kind that leaves a pair as it is (the sign of a turn of zero) is not counted: only pairs in which the wrong poses move
the ground by more than poses can be off.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, planar_pose, relative_motion
from ffseg.freespace.motion.egomotion import given_motion
from ffseg.freespace.sequence import Frame, free_space, segment_view
from ffseg.parameters import load_params
from ffseg.rendering import RenderedPair, floor_pair
from ffseg.rendering.floors import NOISES, TEXTURES
from tests.campaigns import harness

Planar = tuple[float, float, float]
KINDS: dict[str, tuple[Callable[[Planar], Planar], str]] = {
    "theta in degrees": (lambda p: (p[0], p[1], float(np.rad2deg(p[2]))), "theta looks like degrees"),
    "x and y in millimetres": (lambda p: (p[0] * 1e3, p[1] * 1e3, p[2]), "look like millimetres"),
    "x and y in centimetres": (lambda p: (p[0] * 1e2, p[1] * 1e2, p[2]), "look like centimetres"),
    "sign of theta": (lambda p: (p[0], p[1], -p[2]), "theta has the other sign"),
    "sign of y": (lambda p: (p[0], -p[1], p[2]), "y has the other sign"),
    "x and y exchanged": (lambda p: (p[1], p[0], p[2]), "x and y are exchanged"),
    "seen without the mirror": (lambda p: (p[0], -p[1], -p[2]), "y and theta have the other sign"),
    "poses swapped": (lambda p: p, "are swapped"),
    "mount height in millimetres": (lambda p: p, "mount_height 900 m looks like millimetres"),
    "mount height in centimetres": (lambda p: p, "mount_height 90 m looks like centimetres"),
}
"""What is done to each pose, and what is to be said."""
HEIGHTS = {"mount height in millimetres": 1e3, "mount height in centimetres": 1e2}
MATTERS = 8.0
"""Standard deviations of the given poses by which wrong ones must differ from the right ones to be told."""


def wrong(pair: RenderedPair, kind: str) -> tuple[Camera, tuple[Pose, Pose]]:
    """Camera and poses of a pair with one thing wrong."""
    change, _ = KINDS[kind]
    previous, current = (planar_pose(pair.camera, *change(pose)) for pose in pair.poses)
    camera = replace(pair.camera, mount_height=pair.camera.mounting() * HEIGHTS.get(kind, 1.0))
    return camera, (current, previous) if kind == "poses swapped" else (previous, current)


def matters(pair: RenderedPair, kind: str) -> bool:
    """Whether the wrong poses are another motion."""
    if kind in HEIGHTS:
        return True
    right = relative_motion(*(planar_pose(pair.camera, *pose) for pose in pair.poses))
    given = given_motion(wrong(pair, kind)[1])
    turn = np.arccos(np.clip(0.5 * (np.trace(right.rotation.T @ given.rotation) - 1.0), -1.0, 1.0))
    shift = np.linalg.norm(right.translation - given.translation)
    return bool(turn > MATTERS * given.rotation_sigma or shift > 0.02 + MATTERS * given.translation_sigma)


def judged(pair: RenderedPair, kind: str) -> Frame:
    """The pair with one thing wrong."""
    camera, poses = wrong(pair, kind)
    params = load_params()
    found = segment_view(pair.current.image, camera, params)
    return free_space(pair.current.image, found, pair.previous.image, camera, params.obstacles.altitude, poses)


def misses(pair: RenderedPair) -> list[str]:
    """What was not named, or judged all the same."""
    found = []
    for kind, (_, said) in KINDS.items():
        if matters(pair, kind):
            frame = judged(pair, kind)
            if said not in frame.note or {row.verdict for row in frame.components} != {"untested"}:
                found.append(f"{kind}: {frame.note}")
    return found


def main(pairs: int = 15) -> int:
    """Say what was missed."""
    counted, missed = 0, 0
    for index in range(pairs):
        pair = floor_pair(700_000 + index, "plain", TEXTURES[index % 5], NOISES[index // 5 % 3])
        counted += sum(matters(pair, kind) for kind in KINDS)
        for miss in misses(pair):
            missed += 1
            print(f"pair {index} (texture {TEXTURES[index % 5]:g}): {miss}")
    print(f"{counted - missed} of {counted} wrong poses named rightly")
    return 1 if missed else 0


if __name__ == "__main__":
    harness.as_command(main)
