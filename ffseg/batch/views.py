"""The content of ``--camera``, ``--poses`` and ``--pairs`` as plain values, without OpenCV or the core."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from ffseg.camera.calibration import load_mounted_camera
from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, robot_pose
from ffseg.camera.poses import load_pairs, load_poses
from ffseg.io.bags import MARK, bag_of, bag_poses

WINDOW = 8
"""Images before an image that it may be compared with."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraSetup:
    """Camera, poses and pairs of a run; plain values that a worker can be sent."""

    camera: Camera
    poses: Mapping[str, Pose]
    """By image name, without the images that have none."""
    previous: Mapping[str, str]
    """Name of the image before, by image name; a first image has none."""
    stamps: Mapping[str, int] = field(default_factory=dict)
    """Nanoseconds of the images of a bag, by name."""

    def chain(self, name: str) -> tuple[str, ...]:
        """Names of the images before an image, the nearest first, as many as are asked at most."""
        found: list[str] = []
        before = self.previous.get(name)
        while before is not None and before not in (name, *found) and len(found) < WINDOW:
            found.append(before)
            before = self.previous.get(before)
        return tuple(found)

    def poses_of(self, before: str, name: str) -> tuple[Pose, Pose] | None:
        """Poses of an earlier image and of the image; None unless both are known."""
        earlier, pose = self.poses.get(before), self.poses.get(name)
        return (earlier, pose) if earlier is not None and pose is not None else None

    def unposed(self, name: str) -> tuple[str, ...]:
        """Names of an image's pair that the poses file has no row for; none without poses or without an image before."""
        if not self.poses or name not in self.previous:
            return ()
        return tuple(one for one in (self.previous[name], name) if one not in self.poses)

    def camera_text(self) -> str:
        """Everything the camera file said, as one text: equal texts, equal cameras."""
        return json.dumps(asdict(self.camera), default=_plain, sort_keys=True)

    def motion_text(self) -> str:
        """What is known of the poses and pairs of all images, as one text."""
        poses = {name: asdict(pose) for name, pose in self.poses.items()}
        return json.dumps([poses, dict(self.previous)], default=_plain, sort_keys=True)

    def pair_text(self, name: str) -> str:
        """What is known of an image's pairs beside their files."""
        poses = [self.poses_of(before, name) for before in self.chain(name)]
        if not any(poses):
            return ""
        return json.dumps([[asdict(pose) for pose in pair] if pair else None for pair in poses], default=_plain)


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(type(value).__name__)


def load_views(
    camera: str, poses: str | None, pairs: str | None, names: Sequence[str], footprint: float | None = None
) -> CameraSetup:
    """Read the files of a run over images.

    Parameters
    ----------
    camera : str
        Camera file.
    poses, pairs : str or None
        Poses and pairs files; without pairs every image follows the one before it in its folder.
    names : sequence of str
        Relative names of the images in input order, with ``/``.
    footprint : float, optional
        Radius of the robot on the ground, metres, in place of the camera file's.

    Raises
    ------
    CalibrationError
        One line for each thing wrong, with file and key or line; also without ``mount_height``.
    """
    loaded = load_mounted_camera(camera)
    loaded = loaded if footprint is None else replace(loaded, footprint=footprint)
    before = dict(load_pairs(pairs, names)) if pairs else neighbours(names)
    return CameraSetup(loaded, dict(load_poses(poses, names, loaded)) if poses else {}, before)


def with_bag(views: CameraSetup, bag: str, topic: str, stamps: Mapping[str, int]) -> CameraSetup:
    """The views with the times of a bag's images, and with their poses by one of its topics, where a bag is named.

    Raises
    ------
    UsageError
        When there is no such topic.
    """
    if not bag:
        return replace(views, stamps=stamps)
    places = zip(stamps, bag_poses(f"{bag_of(bag)}{MARK}{topic.lstrip('/')}", stamps.values()), strict=True)
    poses = {name: robot_pose(views.camera, *place) for name, place in places if place is not None}
    return replace(views, stamps=stamps, poses=poses)


def neighbours(names: Iterable[str]) -> dict[str, str]:
    """The image before each image in the same folder, by name."""
    last: dict[str, str] = {}
    found = {}
    for name in names:
        folder = os.path.dirname(name)
        if folder in last:
            found[name] = last[folder]
        last[folder] = name
    return found
