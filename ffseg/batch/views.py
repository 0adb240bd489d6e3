"""What ``--camera``, ``--poses`` and ``--pairs`` add to a run: which image comes before which, and the test on pairs."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.camera import Camera, Pose, load_camera, load_pairs, load_poses
from ffseg.formats.overlays import Kind, Polyline
from ffseg.freespace.sequence import Frame, free_space, segment_view
from ffseg.parameters import Parameters
from ffseg.segmenters.base import Segmentation

_KINDS: dict[str, Kind] = {"obstacle": "obstacle", "false_obstacle": "false", "untested": "untested"}


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Camera, poses and pairs of a run; plain values that a worker can be sent.

    Attributes
    ----------
    camera : Camera
    poses : mapping of str to Pose
        By image name, without the images that have none.
    previous : mapping of str to str
        Name of the image before, by image name; a first image has none.
    """

    camera: Camera
    poses: Mapping[str, Pose]
    previous: Mapping[str, str]

    def pair_poses(self, name: str) -> tuple[Pose, Pose] | None:
        """Poses of the image before and of the image; None unless both are known."""
        before, pose = self.poses.get(self.previous.get(name, "")), self.poses.get(name)
        return (before, pose) if before is not None and pose is not None else None


def load_views(camera: str, poses: str | None, pairs: str | None, names: Sequence[str]) -> Views:
    """Read the files of a run over images.

    Parameters
    ----------
    camera : str
        Camera file.
    poses, pairs : str or None
        Poses and pairs files; without pairs every image follows the one before it in its folder.
    names : sequence of str
        Relative names of the images in input order, with ``/``.

    Raises
    ------
    CalibrationError
        One line for each thing wrong, with file and key or line; also without ``mount_height``.
    """
    loaded = load_camera(camera)
    loaded.mounting()
    before = dict(load_pairs(pairs, names)) if pairs else neighbours(names)
    return Views(loaded, dict(load_poses(poses, names, loaded)) if poses else {}, before)


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


def view_frame(
    image: NDArray[np.uint8],
    previous: NDArray[np.uint8] | None,
    name: str,
    views: Views,
    params: Parameters,
    domain: NDArray[np.uint8] | None = None,
) -> Frame:
    """Segment an image and test its components against the image before: depends on nothing else.

    Raises
    ------
    CalibrationError
        When an image has another size than the calibration.
    SegmentationError
        As `ffseg.segment`.
    """
    found = segment_view(image, views.camera, params, domain=domain)
    return free_space(image, found, previous, views.camera, params.obstacles.altitude, views.pair_poses(name))


def merged_segmentation(frame: Frame) -> Segmentation:
    """The segmentation with its false obstacles merged: what masks, contours and counts are written from."""
    return replace(frame.segmentation, mask=frame.mask, contours=frame.contours)


def obstacle_rows(name: str, frame: Frame) -> list[dict[str, Any]]:
    """Lines of ``obstacles.csv``; an altitude that nobody knows is an empty cell."""
    return [
        {
            "image": name,
            "component": row.component,
            "area_px": row.area_px,
            "centroid_x": _cell(row.centroid_x, 2),
            "centroid_y": _cell(row.centroid_y, 2),
            "matched_points": row.matched_points,
            "max_altitude_m": _cell(row.max_altitude_m, 4),
            "verdict": row.verdict,
        }
        for row in frame.components
    ]


def _cell(value: float, digits: int) -> float | str:
    return round(value, digits) if math.isfinite(value) else ""


def overlay_lines(frame: Frame, flatness: float) -> list[Polyline]:
    """Contours of the segmentation, each drawn as what it was found to be."""
    verdicts = iter(frame.components)
    lines = []
    for contour in frame.segmentation.contours:
        kind: Kind = _KINDS[next(verdicts).verdict] if contour.signed_area < 0 else "outer"
        lines.append(Polyline(contour.flatten(flatness), kind))
    return lines
