"""Algorithm 5: free space of the images of a moving camera, with false obstacles merged."""

from __future__ import annotations

import itertools
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image
from ffseg.camera.footprint import footprint_of
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Pose, planar_parameters, relative_motion, require_camera, require_pose
from ffseg.errors import CalibrationError, ParameterError, SegmentationError
from ffseg.freespace.altitudes import altitude_points
from ffseg.freespace.leans import MAX_LEAN_SIGMAS, lean_of
from ffseg.freespace.motion.candidates import SegmentedImage, outer_joints
from ffseg.freespace.motion.egomotion import pair_motion
from ffseg.freespace.motion.ground import GroundFit
from ffseg.freespace.outline import MAX_RANGE, Ground, Scan, ground_of
from ffseg.freespace.pairs import ImagePair
from ffseg.freespace.structural import ComponentVerdict
from ffseg.freespace.tracks import ObstacleTracks
from ffseg.freespace.window import (
    NO_SAMPLES,
    NOTHING_ENCLOSED,
    WINDOW,
    EarlierImage,
    Link,
    window_motion,
    window_verdicts,
)
from ffseg.geometry.freeform import FreeForm
from ffseg.image.checked import Pixels, taken_image
from ffseg.image.components import Component, contour_components, merged
from ffseg.image.free import without_slivers
from ffseg.image.keypoints import grey_image
from ffseg.image.leaks import leaking_pixels
from ffseg.io.masks import named_masks
from ffseg.parameter_files import ParametersLike, parameter_set
from ffseg.parameters import Parameters
from ffseg.pipeline import segment
from ffseg.plugins import method as row_of
from ffseg.result import Segmentation, Timings
from ffseg.scene import Scene

LEAN_SIGMAS = 3.0
"""Standard deviations from which a lean measured by a pair is applied: one level image in a hundred shows as much. An
error of 2 mrad, a pair's precision, shifts the ground by 3 cm at 3.5 m, half a pixel, while outlines are precise to a
twentieth."""
START_MARGIN = 8.0
"""Pixels between the robot's disc and the start circle: the border of the disc is an edge about 5 px wide."""


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
    tested : bool
        Whether any earlier image could be compared with.
    links : tuple of Link
        How the ground moved since those images.
    contradicted : bool
        Whether the ground says that the poses are wrong.
    samples : ndarray of float64, shape (n, 3)
        x, y of samples of the components' outlines; 1: speaks for the ground, -1: against it, 0: says nothing.
    lens : Camera or None
        The camera as calibrated.
    domain : ndarray of bool, shape (H, W), or None
        Where it is known what is free: in the camera's view and the scene's domain, less slivers beside what that leaves
        out. None: all of the view.

    References
    ----------
    Algorithm 5 of the paper.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> first, second = (sequence.feed(ffseg.read_image(f"pictures/pair/{name}.png")) for name in ("0001", "0002"))
    >>> len(second.merged_contours), bool(second.mask.sum() > second.segmentation.mask.sum())
    (3, True)
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
    tested: bool = False
    links: tuple[Link, ...] = ()
    contradicted: bool = False
    samples: NDArray[np.float64] = field(default_factory=lambda: NO_SAMPLES)
    lens: Camera | None = None
    domain: NDArray[np.bool_] | None = None

    def ground(self, reach: float = MAX_RANGE) -> Ground:
        """The free space in metres: polygons with holes in the robot's frame.

        Parameters
        ----------
        reach : float
            Metres; no pixel farther away is told.

        Raises
        ------
        CalibrationError
            When the frame is not of a camera.
        """
        camera = self.standing()
        lean = None if camera is self.lens else lean_of(self.lens, self.camera, self.motion)
        sigma = 0.0 if lean is None else MAX_LEAN_SIGMAS * lean.sigma
        found = ground_of(self.mask, self.contours, camera, reach, self.domain)
        return replace(found, lean_sigma=sigma)

    def scan(self, count: int = 360, reach: float = MAX_RANGE) -> Scan:
        """Ranges at which the free space ends, at evenly spaced bearings, as a laser scanner reports them.

        Raises
        ------
        CalibrationError
            When the frame is not of a camera.
        """
        return self.ground(reach).scan(count)

    def standing(self) -> Camera:
        """The camera as it leaned at the image, if that is sure; else as mounted.

        Raises
        ------
        CalibrationError
            When the frame is not of a camera.
        """
        if self.lens is None:
            raise CalibrationError("the frame is of no camera; segment with ffseg.Sequence(camera, ...)")
        if self.camera is None or self.motion is None:
            return self.lens
        lean = (self.lens.level() @ self.camera.up)[:2]
        error = self.motion.errors()[:, 6:] @ lean
        return self.camera if (lean @ lean) ** 2 > LEAN_SIGMAS**2 * (error @ error) else self.lens

    def __repr__(self) -> str:
        verdicts = Counter(row.verdict for row in self.components)
        counts = ", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts.items())) or "none enclosed"
        return f"<Frame: {np.count_nonzero(self.mask)} px free; components: {counts}; {self.note}>"


def omnidirectional_parameters(params: Parameters, camera: Camera) -> Parameters:
    """Parameters with a start circle outside the robot's own disc, and the image's own edges as evidence.

    What lies under the start circle is the robot's image in part, which is no sample of the ground for the prior.
    """
    if params.edges.source == "auto":
        params = replace(params, edges=replace(params.edges, source="gradient"))
    least = camera.robot_radius + START_MARGIN if camera.robot_radius else 0.0
    if params.init.radius_in((camera.height, camera.width)) >= least:
        return params
    return replace(params, init=replace(params.init, radius=least))


def _check_view(camera: Camera, scene: Scene) -> None:
    """Refuse a camera file by which the image shows no ground, or none but the robot, or a start has its centre outside."""
    (x, y), last, init = camera.center, (camera.width - 1, camera.height - 1), scene.params.init
    placed = init.center != "auto" or init.circles or init.boxes or scene.start_mask is not None
    if not placed and not (-0.5 <= x <= last[0] + 0.5 and -0.5 <= y <= last[1] + 0.5):
        size = f"the image of {camera.width} x {camera.height} pixels"
        raise CalibrationError(f"the camera file has the centre at ({x:g}, {y:g}), outside {size}: correct it there")
    if not camera.domain().any():
        raise CalibrationError(
            "by the camera file no pixel of the image shows ground: correct 'up', or 'rim_radius', there"
        )
    if np.hypot(max(x, last[0] - x), max(y, last[1] - y)) <= camera.robot_radius:
        raise CalibrationError(
            f"the robot's disc of the camera file, of radius {camera.robot_radius:g}, covers the whole image: "
            "correct 'robot_radius' there"
        )


def view_scene(scene: Scene, camera: Camera) -> Scene:
    """The scene of an omnidirectional image: bounded by the camera's rim, started round the robot.

    Parameters
    ----------
    scene : Scene
        Its domain is a further bound.

    Raises
    ------
    CalibrationError
        When the image has another size than the calibration, or shows no ground by it.
    SegmentationError
        When the domain has another size.
    """
    camera.check_size(scene.image.shape[1], scene.image.shape[0], "the image")
    _check_view(camera, scene)
    inside, domain = camera.domain(), scene.domain
    if domain is not None and domain.shape != inside.shape:
        raise SegmentationError(
            f"the domain has {domain.shape[1]} x {domain.shape[0]} pixels, the camera {camera.width} x {camera.height}"
        )
    bound = np.where(inside if domain is None else inside & (domain > 0), np.uint8(255), np.uint8(0))
    params = omnidirectional_parameters(scene.params, camera)
    own = camera.robot_radius + START_MARGIN if camera.robot_radius else 0.0
    footprint = footprint_of(camera, camera.footprint, own) if camera.footprint > 0 else None
    return replace(
        scene, params=params, domain=bound, center=camera.center, robot=camera.robot_radius, footprint=footprint
    )


def segment_frame(scene: Scene, earlier: Iterable[EarlierImage], camera: Camera, *, mapped: bool = False) -> Frame:
    """Segment an image of a sequence and test its components against earlier images.

    Parameters
    ----------
    scene : Scene
        Of the current image; its domain is a bound beside the camera's rim.
    earlier : iterable of Earlier
        Images before it, the nearest first; none for the first image. They are taken one at a time, as they are needed.
    mapped : bool
        Read the motion of an image that encloses nothing, too.

    Raises
    ------
    CalibrationError
        When an image has another size than the calibration.
    SegmentationError
        As `ffseg.segment`.
    """
    bounded, scene = scene.domain is not None, view_scene(scene, camera)
    frame = _frame(scene, itertools.tee(earlier, 1)[0], camera, mapped=mapped)  # a copy of these views begins again
    if not bounded or scene.domain is None:
        return frame
    return replace(frame, domain=without_slivers(scene.domain > 0, camera.domain(), frame.mask))


def _frame(scene: Scene, views: Iterator[EarlierImage], camera: Camera, *, mapped: bool) -> Frame:
    if (scene.method or row_of(scene.params.method)).altitudes:
        before = next(views, None)
        if before is not None:
            return _frame_by_altitudes(scene, before, camera)
    frame = free_space(scene.image, segment(scene), copy(views), camera, scene.params.obstacles.altitude)
    if mapped and frame.note == NOTHING_ENCLOSED:
        frame = _moved(frame, scene, copy(views), camera)
    return _without_leaks(frame, scene, views, camera)


def _without_leaks(frame: Frame, scene: Scene, views: Iterator[EarlierImage], camera: Camera) -> Frame:
    """The frame without free space that has climbed something upright; unconfirmed poses remove nothing."""
    if camera.footprint == 0 or frame.motion is None or frame.fit is None:
        return frame
    before = next(view for view in copy(views) if view.name == frame.links[0].name)
    images = grey_image(scene.image), grey_image(before.image)
    climbed = leaking_pixels(frame.standing(), frame.motion, *images, frame.mask)
    if not climbed.any():
        return frame
    bound = np.where(climbed, np.uint8(0), np.uint8(255) if scene.domain is None else scene.domain)
    again, epsilon = segment(replace(scene, domain=bound)), scene.params.obstacles.altitude
    cut = free_space(scene.image, again, views, camera, epsilon)
    if cut.motion is None:  # nothing is enclosed any more; the camera moved as it did
        cut = replace(cut, motion=frame.motion, camera=frame.camera, fit=frame.fit, links=frame.links)
    remark = f"{np.count_nonzero(climbed)} px of free space that moved as nothing on the ground does were cut off"
    return replace(cut, note=f"{cut.note}; {remark}", obstacles_ms=frame.obstacles_ms + cut.obstacles_ms)


def _moved(frame: Frame, scene: Scene, earlier: Iterable[EarlierImage], camera: Camera) -> Frame:
    """A frame without enclosed components, with its motion."""
    begin = perf_counter()
    segmented = SegmentedImage(frame.mask, (), outer_joints(frame.contours))
    found = window_motion(grey_image(scene.image), segmented, earlier, camera, scene.params.obstacles.altitude)
    pair, spent = found.pair, (perf_counter() - begin) * 1e3
    return replace(
        frame, motion=pair.motion, note=pair.note, camera=pair.camera, fit=pair.fit, links=found.links,
        contradicted=pair.contradicted, obstacles_ms=frame.obstacles_ms + spent,
    )  # fmt: skip


def _frame_by_altitudes(scene: Scene, before: EarlierImage, camera: Camera) -> Frame:
    """Frame of a pair by a method whose own altitude term (Eq. 11) replaces the structural test.

    It runs twice: without the term, for the ground that the motion is read off, then with it.
    """
    begin, epsilon = perf_counter(), scene.params.obstacles.altitude
    previous, current = grey_image(before.image), grey_image(scene.image)
    camera.check_size(previous.shape[1], previous.shape[0], "the previous image")
    first = segment(replace(scene, callback=None))
    chosen = pair_motion(camera, (previous, current), before.poses, SegmentedImage(first.mask), epsilon)
    rows, remark = scene.altitudes, "the snake ran without its altitude term"
    if chosen.motion is not None:
        points = altitude_points(ImagePair(current, previous, chosen.camera or camera, chosen.motion), epsilon)
        rows, remark = points.rows, f"{points.low} points let the snake pass, {len(points.rows) - points.low} bar it"
    second = segment(replace(scene, altitudes=rows))
    spent = (first.timings, second.timings)
    timings = Timings(second.timings.edges_ms, sum(t.evolve_ms for t in spent), sum(t.total_ms for t in spent))
    frame = free_space(scene.image, replace(second, timings=timings), (), camera, epsilon)
    matched_ms = (perf_counter() - begin) * 1e3 - timings.total_ms
    tested = chosen.motion is not None
    return replace(frame, motion=chosen.motion, note=f"{chosen.note}; {remark}", obstacles_ms=matched_ms, tested=tested)


def free_space(
    current: Image, segmentation: Segmentation, earlier: Iterable[EarlierImage], camera: Camera, epsilon: float
) -> Frame:
    """The structural test on a segmented image: a pure function of the images, the camera and the poses.

    Parameters
    ----------
    current : ndarray of uint8, shape (H, W) or (H, W, 3)
    segmentation : Segmentation
        Of the current image.
    earlier : iterable of Earlier
        Images before it, the nearest first: what one pair leaves open is asked of the next. Without poses the motion is
        read off the ground.
    epsilon : float
        ``obstacles.altitude``, metres.

    Raises
    ------
    CalibrationError
        When the camera file has no mount_height, or an earlier image another size.
    """
    begin = perf_counter()
    inner, components = contour_components(segmentation.contours, segmentation.mask.shape)
    others = [contour for place, contour in enumerate(segmentation.contours) if place not in inner]
    segmented = SegmentedImage(segmentation.mask, components, outer_joints(others))
    found = window_verdicts(grey_image(current), segmented, earlier, camera, epsilon)
    bare = Frame(
        segmentation.mask, segmentation.contours, (), found.rows, segmentation, found.pair.motion, found.pair.note, 0.0,
        found.pair.camera, found.pair.fit, found.tested, found.links, found.pair.contradicted, found.samples, camera,
    )  # fmt: skip
    frame = _assembled(bare, found.rows, inner, components)
    return replace(frame, obstacles_ms=(perf_counter() - begin) * 1e3)


def _assembled(
    frame: Frame, rows: tuple[ComponentVerdict, ...], inner: list[int], components: list[Component]
) -> Frame:
    """The frame with these verdicts, and the mask and contours that result from them."""
    paint = {row.component for row in rows if row.verdict == "false_obstacle"}
    dropped = {inner[place] for place in paint}
    contours = frame.segmentation.contours
    return replace(
        frame,
        mask=merged(frame.segmentation.mask, [component for component in components if component.index in paint]),
        contours=tuple(contour for place, contour in enumerate(contours) if place not in dropped),
        merged_contours=tuple(contours[place] for place in sorted(dropped)),
        components=rows,
    )


class Sequence:
    """Free space for a robot, image by image (Algorithm 5).

    Parameters
    ----------
    camera : Camera
    params : Parameters, str, path or mapping, optional
        As `ffseg.segment` takes them.
    method : str, optional
        Segmenter; ``params.method`` without it.
    rgb : bool
        The channels of the images are red, green, blue.
    mapped : bool
        Read the motion off the ground for images that enclose nothing, too: a map needs it where there are no poses.

    Raises
    ------
    CalibrationError
        When the camera is none, or has no mount_height.
    ParameterError
        When a parameter is wrong.

    References
    ----------
    Algorithm 5 and Eq. 9 of the paper.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> first, second = (sequence.feed(ffseg.read_image(f"pictures/pair/{name}.png")) for name in ("0001", "0002"))
    >>> first.tested, [component.verdict for component in second.components]
    (False, ['false_obstacle', 'obstacle', 'obstacle', 'false_obstacle', 'false_obstacle'])
    """

    def __init__(
        self,
        camera: Camera,
        params: ParametersLike = None,
        method: str | None = None,
        *,
        rgb: bool = False,
        mapped: bool = False,
    ) -> None:
        require_camera(camera)
        camera.mounting()
        self._camera, self._rgb, self._mapped = camera, rgb, mapped
        chosen = parameter_set(params)
        self._params = chosen if method is None else replace(chosen, method=method)
        if chosen.domain.masks is not None:
            raise ParameterError("domain.masks finds masks by the names of files; name one of all images: domain.mask")
        self._masks = named_masks(chosen)
        self._earlier: deque[tuple[str, Image, Pose | None]] = deque(maxlen=WINDOW)
        self._tracks = ObstacleTracks(WINDOW + 1)
        self._paint: dict[int, str] = {}
        self._count = 0

    def feed(self, image: Pixels, pose: Pose | None = None) -> Frame:
        """Process the next image, with its pose if there is one.

        Parameters
        ----------
        image : ndarray of uint8, uint16 or float, shape (H, W) or (H, W, 3)
            As `ffseg.segment` takes it.
        pose : Pose, optional
            Where the camera is, metres, from the camera's frame to one that is the same for all images
            (`planar_pose` makes one of x, y and heading). Without the pose of this image or of the one before, the
            motion is read off the ground.

        Raises
        ------
        CalibrationError
            When the image has another size than the calibration, or the pose is none; the sequence stays as it was.
        SegmentationError
            When the image is none, with the sequence as it was; when it cannot be segmented, and the sequence goes on from
            it all the same.
        """
        pixels = taken_image(image, self._rgb, self._params.input.range)
        if pose is not None:
            require_pose(pose)
            pose = replace(pose, rotation=pose.rotation.copy(), position=pose.position.copy())
        self._camera.check_size(pixels.shape[1], pixels.shape[0], "the image")
        name, self._count = str(self._count), self._count + 1
        window = list(self._earlier)
        self._earlier.appendleft((name, grey_image(pixels).copy(), pose))  # the caller's buffer may take the next
        views = [EarlierImage(one, _both(before, pose), number) for number, one, before in window]
        scene = Scene(pixels, self._params, **self._masks.bounds)
        frame = segment_frame(scene, views, self._camera, mapped=self._mapped)
        return self._followed(frame, name, pose, window)

    def _followed(
        self, frame: Frame, name: str, pose: Pose | None, window: list[tuple[str, Image, Pose | None]]
    ) -> Frame:
        """The frame with track numbers; components that were marks before and are undecided now stay marks."""
        links = [(link.name, link.planar) for link in frame.links]
        for number, _, before in window:
            poses = _both(before, pose)
            if poses is not None and not frame.contradicted:
                x, y, turn = planar_parameters(self._camera, relative_motion(*poses)).tolist()
                links.append((number, (x, y, turn)))
        places = np.array([[row.ground_x_m, row.ground_y_m] for row in frame.components]).reshape(-1, 2)
        numbers = self._tracks.follow(name, places, links)
        rows = tuple(replace(row, track=number) for row, number in zip(frame.components, numbers, strict=True))
        self._paint |= {row.track: row.against for row in rows if row.verdict == "false_obstacle"}
        for row in rows:
            if row.decided and row.verdict == "obstacle":
                self._paint.pop(row.track, None)
        kept = tuple(self._kept(row) for row in rows)
        if kept == rows:
            return replace(frame, components=rows)
        return _assembled(frame, kept, *contour_components(frame.segmentation.contours, frame.segmentation.mask.shape))

    def _kept(self, row: ComponentVerdict) -> ComponentVerdict:
        if row.decided or row.track not in self._paint:
            return row
        return replace(row, verdict="false_obstacle", against=self._paint[row.track])


def _both(before: Pose | None, now: Pose | None) -> tuple[Pose, Pose] | None:
    return (before, now) if before is not None and now is not None else None
