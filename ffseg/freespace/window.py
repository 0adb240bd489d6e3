"""Verdicts from several earlier images: what one pair leaves undecided is tested against images farther back."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from ffseg.arrays import Array, Image
from ffseg.camera.model import Camera
from ffseg.camera.motion import Pose, ground_points, planar_parameters
from ffseg.freespace.motion.candidates import SegmentedImage, ground_candidates
from ffseg.freespace.motion.egomotion import PairMotion, pair_motion
from ffseg.freespace.pairs import ImagePair
from ffseg.freespace.structural import ComponentVerdict, structural_test, untested_verdicts
from ffseg.image.keypoints import grey_image
from ffseg.image.planes import pixel_noise

WINDOW = 8
"""Earlier images kept: at steps of 5 cm the farthest is 0.4 m back."""
MAX_PAIRS = 3
"""Pairs with a motion that are evaluated per image; more cost more than they decide."""

NO_SAMPLES = np.empty((0, 3))

FIRST_IMAGE = "first image: nothing to compare with; its components stay untested"
NOTHING_ENCLOSED = "no enclosed component to test"


@dataclass(frozen=True, slots=True, eq=False)
class EarlierImage:
    """An image before the current one.

    Attributes
    ----------
    image : ndarray of uint8, shape (H, W) or (H, W, 3)
    poses : tuple of Pose or None
        Its own and that of the current image, where both are known.
    name : str
        What ``obstacles.csv`` calls it.
    """

    image: Image
    poses: tuple[Pose, Pose] | None = None
    name: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """Motion since an earlier image.

    Attributes
    ----------
    name : str
    planar : tuple of float
        x, y (metres) and turn (radians): a ground point of the current image, in its levelled camera frame, turned by
        the turn and moved by (x, y) is that point in the earlier image's.
    nod : tuple of float
        Radians: up of the earlier camera, where it leaned toward x and y of its levelled frame, less that of the current
        one, turned by the turn. 0 where only poses speak.
    sigmas : tuple of float
        Standard deviations of the motion, metres and radians.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> first, second = (sequence.feed(ffseg.read_image(f"pictures/pair/{name}.png")) for name in ("0001", "0002"))
    >>> [link.name for link in second.links], round(second.links[0].planar[2], 2)
    (['0'], 0.27)
    """

    name: str
    planar: tuple[float, float, float]
    nod: tuple[float, float] = (0.0, 0.0)
    sigmas: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class WindowVerdicts:
    """Verdicts from the earlier images.

    Attributes
    ----------
    pair : PairMotion
        Of the image before, or the first of the others that has a motion.
    tested : bool
        Whether any pair had a motion.
    links : tuple of Link
        One for each pair with a motion, the nearest image first; without any, of the nearest pair that lies too close to
        judge by.
    samples : ndarray of float64, shape (n, 3)
        Of the components' outlines, as `structural_test` hands them out; of all pairs with a motion.
    """

    rows: tuple[ComponentVerdict, ...]
    pair: PairMotion
    tested: bool = False
    links: tuple[Link, ...] = ()
    samples: Array = field(default_factory=lambda: NO_SAMPLES)


def window_verdicts(
    current: Image, segmented: SegmentedImage, earlier: Iterable[EarlierImage], camera: Camera, epsilon: float
) -> WindowVerdicts:
    """Verdicts on the components of an image.

    Parameters
    ----------
    current : ndarray of uint8, shape (H, W)
    earlier : iterable of Earlier
        The nearest first; taken one at a time, and only as long as a component is undecided.
    epsilon : float
        ``obstacles.altitude``, metres.

    Raises
    ------
    CalibrationError
        When an earlier image has another size, or the camera file no mount_height.
    """
    components = segmented.components
    rows = untested_verdicts(components)
    first: PairMotion | None = None
    links: list[Link] = []
    still: list[Link] = []
    samples: list[Array] = [NO_SAMPLES]
    views = iter(earlier)
    nearest = next(views, None)
    if nearest is None or not components:
        return WindowVerdicts(
            _placed(rows, camera), PairMotion(None, FIRST_IMAGE if nearest is None else NOTHING_ENCLOSED)
        )
    noise, candidates = pixel_noise(current, segmented.free), ground_candidates(camera, current, segmented)
    for view in itertools.chain([nearest], views):
        camera.check_size(view.image.shape[1], view.image.shape[0], "the previous image")
        before = grey_image(view.image)
        pair = pair_motion(camera, (before, current), view.poses, segmented, epsilon, candidates)
        if first is None or (first.motion is None and pair.motion is not None):
            first = pair if first is None else replace(pair, note=f"{first.note}; {view.name}: {pair.note}")
        if pair.contradicted:
            break
        if pair.motion is None:
            still += _links(view.name, camera, pair.still)
            continue
        own = pair.camera or camera
        seen = ImagePair(current, before, own, pair.motion, noise)
        found = _placed(
            structural_test(seen, components, epsilon, pair.fit, samples, candidates.corners), own, view.name
        )
        rows = tuple(map(_better, rows, found))
        links += _links(view.name, camera, pair)
        if len(links) == MAX_PAIRS or all(row.decided for row in rows):
            break
    rows = rows if links else _placed(rows, camera)
    used = tuple(links or still[:1])
    return WindowVerdicts(rows, first or PairMotion(None, NOTHING_ENCLOSED), bool(links), used, np.concatenate(samples))


def window_motion(
    current: Image, segmented: SegmentedImage, earlier: Iterable[EarlierImage], camera: Camera, epsilon: float
) -> WindowVerdicts:
    """The motion of an image without enclosed components, which a map needs.

    Parameters
    ----------
    current, scenery, earlier, camera, epsilon
        As `window_verdicts` takes them; ``MAX_PAIRS`` images are asked at most.

    Raises
    ------
    CalibrationError
        When an earlier image has another size.
    """
    candidates, note = ground_candidates(camera, current, segmented), NOTHING_ENCLOSED
    for view in itertools.islice(earlier, MAX_PAIRS):
        camera.check_size(view.image.shape[1], view.image.shape[0], "the previous image")
        pair = pair_motion(camera, (grey_image(view.image), current), view.poses, segmented, epsilon, candidates)
        note = f"{NOTHING_ENCLOSED}; {pair.note}"
        links = _links(view.name, camera, pair if pair.motion is not None else pair.still)
        if links or pair.contradicted:
            return WindowVerdicts((), replace(pair, note=note), links=tuple(links))
    return WindowVerdicts((), PairMotion(None, note))


def _better(old: ComponentVerdict, new: ComponentVerdict) -> ComponentVerdict:
    """The decided verdict; of undecided ones the first with a matched point."""
    return new if not old.decided and (new.decided or old.verdict == "untested") else old


def _placed(rows: tuple[ComponentVerdict, ...], camera: Camera, against: str = "") -> tuple[ComponentVerdict, ...]:
    """Verdicts with the places of their components on the ground."""
    if not rows:
        return rows
    places = ground_points(camera, np.array([[row.centroid_x, row.centroid_y] for row in rows]))
    return tuple(
        replace(row, ground_x_m=float(x), ground_y_m=float(y), against="" if row.verdict == "untested" else against)
        for row, (x, y) in zip(rows, places, strict=True)
    )


def _links(name: str, camera: Camera, pair: PairMotion | None) -> list[Link]:
    """The link of a pair with a motion."""
    if pair is None or pair.motion is None:
        return []
    motion = pair.motion
    x, y, turn = planar_parameters(pair.camera or camera, motion).tolist()
    nod_x, nod_y = (-camera.level()[:2] @ motion.rotation @ camera.level()[2]).tolist()
    return [Link(name, (x, y, turn), (nod_x, nod_y), (motion.translation_sigma, motion.rotation_sigma))]
