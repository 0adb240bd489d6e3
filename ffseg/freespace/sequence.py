"""Algorithm 5: free space of the images of a moving camera, with false obstacles merged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Pose
from ffseg.errors import SegmentationError
from ffseg.freespace.altitudes import altitude_points
from ffseg.freespace.egomotion import PairMotion, pair_motion
from ffseg.freespace.evidence import Scenery, outer_joints
from ffseg.freespace.ground import GroundFit
from ffseg.freespace.structural import ComponentVerdict, ImagePair, structural_test, untested
from ffseg.geometry.freeform import FreeForm
from ffseg.image.components import contour_components, merged
from ffseg.image.keypoints import Grey, grey_image
from ffseg.image.planes import pixel_noise
from ffseg.parameters import Parameters
from ffseg.segmenters.base import Progress, Segmentation, Segmenter, Timings
from ffseg.segmenters.registry import segment

START_MARGIN = 8.0
"""Pixels between the robot's disc and the start circle: the disc's border is an edge some 5 px wide."""

FIRST_IMAGE = "first image: nothing to compare with; its components stay untested"
NOTHING_ENCLOSED = "no enclosed component to test"

Segmenting = Callable[..., Segmentation]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """Free space of one image.

    Attributes
    ----------
    mask : ndarray of bool, shape (H, W)
        Free space with false obstacles merged. The robot's own disc counts as free.
    contours : tuple of FreeForm
        Contours of the merged free space.
    merged_contours : tuple of FreeForm
        Inner contours that were found to be false obstacles.
    components : tuple of ComponentVerdict
        One row per inner contour, in the order of the segmentation.
    segmentation : Segmentation
        Before the structural test.
    motion : Motion or None
        Of the camera since the previous image.
    note : str
        Where the motion comes from, or why nothing was tested.
    obstacles_ms : float
        Wall time of motion and structural test.
    camera : Camera or None
        The current camera with its true ``up``, where the ground was asked.
    fit : GroundFit or None
        The points that the motion was read off.
    """

    mask: NDArray[np.bool_]
    contours: tuple[FreeForm, ...]
    merged_contours: tuple[FreeForm, ...]
    components: tuple[ComponentVerdict, ...]
    segmentation: Segmentation
    motion: Motion | None
    note: str
    obstacles_ms: float
    camera: Camera | None = None
    fit: GroundFit | None = None


def omnidirectional_parameters(params: Parameters, camera: Camera) -> Parameters:
    """Parameters with a start circle that keeps clear of the robot's own disc."""
    least = camera.robot_radius + START_MARGIN if camera.robot_radius else 0.0
    if params.init.radius >= least:
        return params
    return replace(params, init=replace(params.init, radius=least))


def segment_view(  # noqa: PLR0913 - what `segment` takes, and the camera
    image: Grey,
    camera: Camera,
    params: Parameters,
    method: str | Segmenter | None = None,
    *,
    domain: NDArray[np.uint8] | None = None,
    start_mask: NDArray[np.uint8] | None = None,
    altitudes: NDArray[np.float64] | None = None,
    callback: Callable[[Progress], None] | None = None,
) -> Segmentation:
    """Segment one omnidirectional image inside the camera's rim, from round the robot.

    Parameters
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    camera : Camera
    params : Parameters
    method : str or Segmenter, optional
    domain : ndarray of uint8, shape (H, W), optional
        A further bound, nonzero where the contour may go.
    start_mask : ndarray of uint8, shape (H, W), optional
        Nonzero inside the start regions; takes the place of the start circle.
    altitudes : ndarray of float64, shape (K, 4), optional
        Interest points for the snake, as `ffseg.segment`.
    callback : callable, optional
        Called with snapshots of the evolution.

    Raises
    ------
    CalibrationError
        When the image has another size than the calibration.
    SegmentationError
        As `ffseg.segment`.
    """
    camera.check_size(image.shape[1], image.shape[0], "the image")
    inside = camera.domain()
    if domain is not None and domain.shape != inside.shape:
        raise SegmentationError(
            f"the domain has {domain.shape[1]} x {domain.shape[0]} pixels, the camera {camera.width} x {camera.height}"
        )
    bound = np.where(inside if domain is None else inside & (domain > 0), np.uint8(255), np.uint8(0))
    params = omnidirectional_parameters(params, camera)
    return segment(
        image,
        params,
        method,
        domain=bound,
        start_mask=start_mask,
        center=camera.center,
        altitudes=altitudes,
        callback=callback,
    )


def segment_frame(
    images: tuple[Grey, Grey | None],
    camera: Camera,
    params: Parameters,
    poses: tuple[Pose, Pose] | None,
    segmenting: Segmenting,
    callback: Callable[[Progress], None] | None = None,
) -> Frame:
    """Segment an image of a sequence and test it against the image before.

    Parameters
    ----------
    images : tuple of ndarray of uint8, shape (H, W) or (H, W, 3)
        The current image and the one before it, None for the first.
    camera : Camera
    params : Parameters
        ``method``, and what `free_space` takes.
    poses : tuple of Pose or None
        Of the previous and the current image.
    segmenting : callable
        ``segmenting(method, callback=callback)`` segments the current image by a name or a `Segmenter`.
    callback : callable, optional
        Called with snapshots of the evolution.

    Raises
    ------
    CalibrationError
        When an image has another size than the calibration.
    SegmentationError
        As `ffseg.segment`.
    """
    current, previous = images
    if params.method == "snake" and previous is not None:
        return _snake_frame((previous, current), camera, params, poses, segmenting, callback)
    found = segmenting(params.method, callback=callback)
    return free_space(current, found, previous, camera, params.obstacles.altitude, poses)


def _snake_frame(
    images: tuple[Grey, Grey],
    camera: Camera,
    params: Parameters,
    poses: tuple[Pose, Pose] | None,
    segmenting: Segmenting,
    callback: Callable[[Progress], None] | None,
) -> Frame:
    """Frame of a pair by the snake, whose own term (Eq. 11) stands for the structural test.

    The snake runs twice: without the term, for the ground that the motion is read off, then with it.
    """
    begin, epsilon = perf_counter(), params.obstacles.altitude
    previous, current = (grey_image(image) for image in images)
    camera.check_size(previous.shape[1], previous.shape[0], "the previous image")
    first = segmenting("snake")
    chosen = pair_motion(camera, (previous, current), poses, Scenery(first.mask), epsilon)
    rows, said = None, "the snake ran without its altitude term"
    if chosen.motion is not None:
        points = altitude_points(ImagePair(current, previous, chosen.camera or camera, chosen.motion), epsilon)
        rows, said = points.rows, f"{points.low} points let the snake pass, {len(points.rows) - points.low} bar it"
    second = segmenting("snake", callback=callback, altitudes=rows)
    spent = (first.timings, second.timings)
    timings = Timings(second.timings.edges_ms, sum(t.evolve_ms for t in spent), sum(t.total_ms for t in spent))
    frame = free_space(current, replace(second, timings=timings), None, camera, epsilon)
    matched_ms = (perf_counter() - begin) * 1e3 - timings.total_ms
    return replace(frame, motion=chosen.motion, note=f"{chosen.note}; {said}", obstacles_ms=matched_ms)


def free_space(
    current: Grey,
    segmentation: Segmentation,
    previous: Grey | None,
    camera: Camera,
    epsilon: float,
    poses: tuple[Pose, Pose] | None = None,
) -> Frame:
    """The structural test on a segmented image: a pure function of two images, the camera and the poses.

    Parameters
    ----------
    current : ndarray of uint8, shape (H, W) or (H, W, 3)
    segmentation : Segmentation
        Of the current image.
    previous : ndarray of uint8 or None
        None for the first image.
    camera : Camera
    epsilon : float
        ``obstacles.altitude``, metres.
    poses : tuple of Pose, optional
        Of the previous and the current image; without them the motion is read off the ground.

    Raises
    ------
    CalibrationError
        When the camera file has no mount_height, or the previous image another size.
    """
    begin = perf_counter()
    inner, components = contour_components(segmentation.contours, segmentation.mask.shape)
    chosen = PairMotion(None, FIRST_IMAGE if previous is None else NOTHING_ENCLOSED)
    rows: tuple[ComponentVerdict, ...] | None = None
    if previous is not None and components:
        camera.check_size(previous.shape[1], previous.shape[0], "the previous image")
        pair = (grey_image(previous), grey_image(current))
        scenery = Scenery(segmentation.mask, components, outer_joints(segmentation.contours))
        chosen = pair_motion(camera, pair, poses, scenery, epsilon)
        if chosen.motion is not None:
            noise = pixel_noise(pair[1], segmentation.mask)
            seen = ImagePair(pair[1], pair[0], chosen.camera or camera, chosen.motion, noise)
            rows = structural_test(seen, components, epsilon, chosen.fit)
    rows = untested(components) if rows is None else rows
    paint = {row.component for row in rows if row.verdict == "false_obstacle"}
    dropped = {inner[place] for place in paint}
    return Frame(
        merged(segmentation.mask, [component for component in components if component.index in paint]),
        tuple(contour for place, contour in enumerate(segmentation.contours) if place not in dropped),
        tuple(segmentation.contours[place] for place in sorted(dropped)),
        rows, segmentation, chosen.motion, chosen.note, (perf_counter() - begin) * 1e3, chosen.camera, chosen.fit,
    )  # fmt: skip


class Sequence:
    """Free space for a robot: fed one image at a time (Algorithm 5).

    Parameters
    ----------
    camera : Camera
    params : Parameters
    method : str, optional
        Segmenter; ``params.method`` without it.

    Examples
    --------
    >>> sequence = Sequence(camera, params)  # doctest: +SKIP
    >>> for image in images:  # doctest: +SKIP
    ...     frame = sequence.feed(image)
    ...     frame.mask
    """

    def __init__(self, camera: Camera, params: Parameters, method: str | None = None) -> None:
        camera.mounting()
        self._camera = camera
        self._params = params if method is None else replace(params, method=method)
        self._previous: Grey | None = None
        self._pose: Pose | None = None

    def feed(self, image: Grey, pose: Pose | None = None) -> Frame:
        """Take the next image, with its pose when there is one.

        Parameters
        ----------
        image : ndarray of uint8, shape (H, W) or (H, W, 3)
        pose : Pose, optional
            Where the camera is, metres, from the camera's frame to one that is the same for all images
            (`planar_pose` makes one of x, y and heading). Without the pose of this image or of the one before, the
            motion is read off the ground.

        Raises
        ------
        CalibrationError
            When the image has another size than the calibration; the sequence stays as it was.
        SegmentationError
            When the image cannot be segmented; the sequence goes on from it all the same.
        """
        self._camera.check_size(image.shape[1], image.shape[0], "the image")
        previous, before = self._previous, self._pose
        self._previous, self._pose = grey_image(image), pose
        poses = (before, pose) if before is not None and pose is not None else None
        segmenting = partial(segment_view, image, self._camera, self._params)
        return segment_frame((image, previous), self._camera, self._params, poses, segmenting)
