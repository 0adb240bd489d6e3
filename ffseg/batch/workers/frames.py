"""Free space from pairs inside a worker: the frame of one image, and its outputs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np

from ffseg.batch.views import CameraSetup
from ffseg.errors import ImageReadError
from ffseg.freespace.leans import lean_of
from ffseg.freespace.sequence import Frame, segment_frame
from ffseg.freespace.sightings import sigmas_of
from ffseg.freespace.window import FIRST_IMAGE, NOTHING_ENCLOSED, EarlierImage
from ffseg.io.exports import run_lengths
from ffseg.io.files import printable
from ffseg.io.images import Limits, decode_image
from ffseg.io.overlays import Kind, Polyline
from ffseg.parameters import Levels
from ffseg.result import Segmentation
from ffseg.scene import Scene

_KINDS: dict[str, Kind] = {"obstacle": "obstacle", "false_obstacle": "false", "untested": "untested"}


@dataclass(frozen=True, slots=True, eq=False)
class EarlierImages:
    """The images before an image: where their camera stood, and what can be read of them."""

    views: CameraSetup
    name: str
    """Of the image itself."""
    data: Sequence[bytes]
    """Files' contents, the nearest first; empty, which no decoder takes, where one cannot be read."""
    limits: Limits

    def frame(self, scene: Scene, *, mapped: bool = False) -> Frame:
        """Segment the image of a scene, and test its components against the images before.

        Images before it that cannot be read, or have another size, are passed over; of the nearest one the note says so.

        Parameters
        ----------
        mapped : bool
            The motion is wanted of every image, whether it encloses something or not.

        Raises
        ------
        CalibrationError
            When an image has another size than the calibration.
        """
        found = (self._image(place, scene.params.input.range) for place in range(len(self.data)))
        nearest = next(found, "")
        earlier = [nearest] if isinstance(nearest, EarlierImage) else []
        farther = (view for view in found if isinstance(view, EarlierImage))
        frame = segment_frame(scene, chain(earlier, farther), self.views.camera, mapped=mapped)
        unposed = " and ".join(map(printable, self.views.unposed(self.name)))
        frame = replace(frame, note=f"no pose of {unposed}; {frame.note}") if unposed else frame
        if earlier or not self.data:
            return frame
        problem = f"{printable(self.views.chain(self.name)[0])} cannot be used: {nearest}"
        if frame.note == FIRST_IMAGE:
            return replace(frame, note=f"the previous image {problem}; nothing was tested")
        return replace(frame, note=f"{frame.note}; the image before, {problem}")

    def _image(self, place: int, levels: Levels) -> EarlierImage | str:
        camera, before = self.views.camera, self.views.chain(self.name)[place]
        try:
            image = decode_image(self.data[place], self.limits, levels)
        except ImageReadError as error:
            return str(error)
        if image.shape[:2] != (camera.height, camera.width):
            return f"it is {image.shape[1]}x{image.shape[0]}, the camera file says {camera.width}x{camera.height}"
        return EarlierImage(image, self.views.poses_of(before, self.name), printable(before))


def merged_segmentation(frame: Frame) -> Segmentation:
    """The segmentation with its false obstacles merged: what masks, contours and counts are written from."""
    return replace(frame.segmentation, mask=frame.mask, contours=frame.contours)


def obstacle_rows(frame: Frame) -> list[dict[str, Any]]:
    """Lines of ``obstacles.csv`` without the image's name; what nobody knows is an empty cell.

    The links are no column: the run numbers the things of a sequence by them.
    """
    return [
        {
            "component": row.component,
            "area_px": row.area_px,
            "centroid_x": _cell(row.centroid_x, 2),
            "centroid_y": _cell(row.centroid_y, 2),
            "matched_points": row.matched_points,
            "max_altitude_m": _cell(row.max_altitude_m, 4),
            "verdict": row.verdict,
            "against": row.against,
            "ground_x_m": _cell(row.ground_x_m, 3),
            "ground_y_m": _cell(row.ground_y_m, 3),
            "links": [[link.name, *link.planar] for link in frame.links],
        }
        for row in frame.components
    ]


def _cell(value: float, digits: int) -> float | str:
    return round(value, digits) if math.isfinite(value) else ""


def camera_state(frame: Frame) -> dict[str, Any]:
    """How the camera stood at an image, how it moved since earlier ones, and what of its view was left out, for the map."""
    moved = [[link.name, *link.planar, *link.nod] for link in frame.links]
    seen = lean_of(frame.lens, frame.camera, frame.motion)
    lean = None if seen is None else [seen.x, seen.y, seen.sigma, seen.nod_sigma]
    up = frame.standing().up.tolist()
    state = {"up": up, "moved": moved, "sigmas": [float(one) for one in sigmas_of(frame)], "lean": lean}
    state |= {"contradicted": True} if frame.contradicted else {}
    if frame.lens is None or frame.domain is None:
        return state
    return state | {"left_out": run_lengths(frame.lens.domain() & ~frame.domain)}


def pair_state(frame: Frame) -> str:
    """What came of comparing an image with those before: one of four words."""
    if frame.tested:
        return "tested"
    if frame.note.startswith(NOTHING_ENCLOSED):
        return "empty"
    return "first" if frame.note == FIRST_IMAGE else "untested"


RESIDUAL_SCALE = 10.0
"""Times its length that a residual is drawn with: it is a part of a pixel."""
_DOT = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
_CROSS = np.array([[-2.0, -2.0], [2.0, 2.0]])


def evidence_lines(frame: Frame) -> list[Polyline]:
    """Points that the ground was asked at, with their residuals, and samples of the components' outlines as crosses."""
    lines: list[Polyline] = []
    if frame.fit is not None:
        kinds: list[Kind] = ["agrees" if one else "differs" for one in frame.fit.inliers.tolist()]
        for place, residual, kind in zip(frame.fit.tracks.current, frame.fit.residual, kinds, strict=True):
            lines.append(Polyline(place + _DOT, kind))
            if kind == "agrees":
                lines.append(Polyline(np.stack([place, place + RESIDUAL_SCALE * residual]), kind))
    votes: dict[int, Kind] = {1: "agrees", -1: "differs", 0: "silent"}
    for x, y, vote in frame.samples.tolist():
        lines += [Polyline(np.array([x, y]) + arm, votes[int(vote)]) for arm in (_CROSS, _CROSS * [1.0, -1.0])]
    return lines


def overlay_lines(frame: Frame, flatness: float) -> list[Polyline]:
    """Contours of the segmentation, each drawn as what it was found to be."""
    verdicts = iter(frame.components)
    lines = []
    for contour in frame.segmentation.contours:
        kind: Kind = _KINDS[next(verdicts).verdict] if contour.signed_area < 0 else "outer"
        lines.append(Polyline(contour.flatten(flatness), kind))
    return lines
