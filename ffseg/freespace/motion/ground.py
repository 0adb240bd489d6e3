"""Motion from the ground: candidate points placed in both images, and a robust fit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Image
from ffseg.camera.model import Camera
from ffseg.camera.motion import PARAMETERS, Motion, Origin, perturbed, point_slopes, projection_slopes
from ffseg.freespace.motion.candidates import FREE, GroundCandidates
from ffseg.freespace.motion.tracking import Look, TrackedPoints, track_points

NOD, LEAN, LIFT = np.deg2rad(0.15), np.deg2rad(0.15), 0.002
"""Standard deviations of nod, lean (radians) and lift (metres): the plane as a strong prior."""
HEAVY_TAIL = 2.0
"""Standard deviations from which a nod measured from the ground is used without shrinkage, as robots do nod occasionally."""
MAX_DEVIATION = np.array([0.05, *[np.deg2rad(4.5)] * 4])
"""Lift, nods and leans (metres, radians) beyond which a motion is a chance agreement and not that of a robot on a floor."""
GATE = 3.5
"""Standard deviations: inlier threshold on a whitened residual."""
MAX_PRIOR_COST = 25.0
"""Largest cost of deviating from the prior when motions are compared: that of two outliers."""
TRIALS, SAMPLE, BATCHES, JUDGES = 96, 4, 5, 150
"""RANSAC: minimal sets per batch, points per set, batches, and points that score them. With 40 % inliers all batches
miss a clean set once in 200,000 times, and the prior is a trial of its own."""
CLEAR_FRACTION = 0.55
"""Fraction of inliers from which no further batch is drawn."""
ROUNDS = 6
CONVERGED = 1e-5
"""Metres and radians: a step below a tenth of what the ground can resolve ends the refinement."""
MAX_PREDICTION_CHANGE = 0.3
"""Pixels by which a refined motion may change predictions for the placements made from them to remain valid."""
MIN_INLIERS = 8
"""Least number of inliers: the motion has five parameters without a prior."""
MIN_OWNERS = 3
"""Least number of different owners among the inliers; every point of the free space is its own."""
MIN_INLIER_FRACTION = 0.35
"""Least fraction of well-placed points that must be inliers: the rest moves, shines or stands above the ground."""


@dataclass(frozen=True, slots=True, eq=False)
class GroundFit:
    """A motion with its ground plane, and the points it was estimated from.

    Attributes
    ----------
    camera : Camera
        The current camera with its true ``up``.
    motion : Motion
    offset : ndarray of float64, shape (8,)
        What was corrected of the prior, as `perturbed` takes it.
    tracks : TrackedPoints
    inliers : ndarray of bool, shape (n,)
    residual : ndarray of float64, shape (n, 2)
        Found less predicted, pixels.
    slopes : ndarray of float64, shape (n, 2, 8)
        d(previous pixel)/d(parameters).
    levers, white : ndarray of float64, shape (n, 2, 8) and (n, 2)
        Slopes and residuals in standard deviations.
    hold : ndarray of float64, shape (8, 8)
        What the prior knows: the inverse of its covariance.

    Examples
    --------
    >>> sequence = ffseg.Sequence(ffseg.load_camera("pictures/pair/camera.yaml"))
    >>> first, second = (sequence.feed(ffseg.read_image(f"pictures/pair/{name}.png")) for name in ("0001", "0002"))
    >>> int(second.fit.inliers.sum()) == second.fit.count, second.fit.residual.shape[1]
    (True, 2)
    """

    camera: Camera
    motion: Motion
    offset: Array
    tracks: TrackedPoints
    inliers: NDArray[np.bool_]
    residual: Array
    slopes: Array
    levers: Array
    white: Array
    hold: Array

    @property
    def count(self) -> int:
        """Number of inliers."""
        return int(np.count_nonzero(self.inliers))

    @property
    def share(self) -> float:
        """Fraction of inliers among the well-placed points."""
        return self.count / max(1, len(self.inliers))

    @property
    def answer(self) -> float:
        """Fraction of inliers among the points that should have been placed."""
        return self.count / max(1, self.tracks.num_expected)

    def without(self, count: int) -> Doubt:
        """For each component, the motion estimated from all other points."""
        levers, white, owner = self.levers[self.inliers], self.white[self.inliers], self.tracks.owner[self.inliers]
        whole, squares = _normal(levers) + self.hold, np.sum(white**2, axis=1)
        owned = owner >= 0
        mine = (owner[owned] == np.arange(count)[:, None]).astype(np.float64)
        turned = np.swapaxes(levers[owned], 1, 2)
        normals = (turned @ levers[owned]).reshape(-1, PARAMETERS * PARAMETERS)
        inverses = np.linalg.inv(whole - (mine @ normals).reshape(-1, PARAMETERS, PARAMETERS))
        pulls = mine @ (turned @ white[owned][..., None])[..., 0]
        own = mine.sum(axis=1)
        scatter = (squares.sum() - mine @ squares[owned]) / np.maximum(1.0, 2.0 * (len(white) - own) - 5.0)
        things = _things(owner) - (own > 0)
        known = (len(owner) - own >= MIN_INLIERS) & (things >= _needed(self.motion.origin))
        known |= self.motion.origin != "ground points"  # the poses hold what the others leave open
        steps = -(inverses @ pulls[..., None])[..., 0]
        return Doubt(steps, inverses * np.maximum(scatter, 1.0)[:, None, None], known)

    def slopes_near(self, places: Array) -> Array:
        """Slopes at the points nearest to places, shape (m, 2), of the current image: shape (m, 2, 8)."""
        x, y = (self.tracks.current[:, axis] - places[:, axis, None] for axis in (0, 1))
        near: Array = self.slopes[np.argmin(x * x + y * y, axis=1)]
        return near


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """Uncertainty of the motion without a component's own points.

    Attributes
    ----------
    steps : ndarray of float64, shape (count, 8)
        By how much the motion would be another, as `perturbed` takes it.
    covariances : ndarray of float64, shape (count, 8, 8)
    known : ndarray of bool, shape (count,)
        False where the others do not give a motion.

    Examples
    --------
    >>> doubt = ffseg.Doubt(np.zeros((2, 8)), np.zeros((2, 8, 8)), np.array([True, False]))
    >>> int(doubt.known.sum())
    1
    """

    steps: Array
    covariances: Array
    known: NDArray[np.bool_]

    def of(self, places: list[int]) -> Doubt:
        """That of some of the components."""
        return Doubt(self.steps[places], self.covariances[places], self.known[places])


def shared_doubt(motion: Motion, count: int) -> Doubt:
    """The same for components whose points were not used in the motion."""
    errors = motion.errors()
    covariances = np.tile(errors.T @ errors, (count, 1, 1))
    return Doubt(np.zeros((count, PARAMETERS)), covariances, np.ones(count, np.bool_))


def prior_sigmas(translation: float, rotation: float) -> Array:
    """Standard deviations of the eight parameters of a prior."""
    return np.array([translation, translation, rotation, LIFT, NOD, NOD, LEAN, LEAN])


def fit_ground(
    camera: Camera,
    prior: Motion,
    sigmas: Array,
    pair: tuple[Image, Image],
    candidates: GroundCandidates,
    looks: tuple[Look, ...],
) -> GroundFit | None:
    """Correct a motion so that ground points agree in both images.

    Parameters
    ----------
    prior : Motion
        What it says of its own origin, the result says as well.
    sigmas : ndarray of float64, shape (8,)
        Of the prior's parameters, as `prior_sigmas` gives them.
    pair : tuple of ndarray of uint8, shape (H, W)
        Current and previous image.
    looks : tuple of str
        How the points are placed, one after another: ``far`` looks for each within 16 pixels of where it is expected,
        ``half`` at half the resolution first, ``full`` as the images stand.

    Returns
    -------
    GroundFit or None
        None where too few points agree.
    """
    offset, fit, here = np.zeros(PARAMETERS), None, (camera, prior)
    for look in looks:
        tracks = track_points(*here, pair, candidates, look)
        fit = _fitted(*here, tracks, offset, sigmas, first=fit is None)
        if fit is None:
            return None
        step = np.abs(tracks.previous - fit.residual - tracks.start)  # of what it predicts now
        offset, here = fit.offset, (fit.camera, fit.motion)
        if look == "full" and len(step) and np.nanmedian(step) < MAX_PREDICTION_CHANGE:
            break
    return fit


def _fitted(
    camera: Camera, motion: Motion, tracks: TrackedPoints, offset: Array, sigmas: Array, *, first: bool
) -> GroundFit | None:
    """Parameters by RANSAC, then by least squares with a hard gate; the motion is linear near its prior."""
    if len(tracks.current) < MIN_INLIERS:
        return None
    root = np.linalg.cholesky(tracks.information)
    slopes = position_slopes(camera, motion, tracks.current)
    levers = np.swapaxes(root, 1, 2) @ slopes
    miss = np.einsum("nji,nj->ni", root, tracks.previous - tracks.start)
    total = _consensus(levers, miss, offset, sigmas) if first else offset
    for _ in range(ROUNDS):
        white = miss - levers @ (total - offset)
        inliers = np.sum(white**2, axis=1) < GATE**2
        own = np.maximum(sigmas, np.abs(total) / HEAVY_TAIL)
        hold = np.diag(1.0 / own**2)
        normal = _normal(levers[inliers]) + hold
        step = np.linalg.solve(normal, np.einsum("nij,ni->j", levers[inliers], white[inliers]) - hold @ total)
        total = total + step
        if np.abs(step).max() < CONVERGED:
            break
    agree = tracks.owner[inliers]
    few = len(agree) < MIN_INLIERS or _things(agree) < _needed(motion.origin)
    if few or inliers.sum() < MIN_INLIER_FRACTION * len(inliers):  # one thing alone would carry the ground with it
        return None
    if np.any(np.abs(total[3:]) > MAX_DEVIATION):
        return None
    white = miss - levers @ (total - offset)
    covariance = np.asarray(np.linalg.inv(normal) * _scatter(white[inliers]), np.float64)
    fixed = _moved(camera, motion, total - offset, covariance, int(inliers.sum()))
    residual = tracks.previous - predictions(*fixed, tracks.current, np.zeros((1, PARAMETERS)))[0]
    return GroundFit(*fixed, total, tracks, inliers, residual, slopes, levers, white, hold)


def _things(owners: NDArray[np.intp]) -> int:
    free = owners == FREE
    return int(np.count_nonzero(free)) + len(set(owners[~free].tolist()))


def _needed(origin: Origin) -> int:
    return MIN_OWNERS if origin == "ground points" else 1


def _consensus(levers: Array, miss: Array, offset: Array, sigmas: Array) -> Array:
    """The best of many parameter sets through ``SAMPLE`` points and the prior, and of the prior itself."""
    random = np.random.default_rng(0)
    seen = miss + levers @ offset
    judges = random.permutation(len(levers))[:JUDGES]
    best: Array = offset
    least = float("inf")
    for _ in range(BATCHES):
        trials = np.concatenate([_trials(random, levers, seen, sigmas), np.zeros((1, PARAMETERS)), best[None]])
        left = seen[judges].ravel() - trials @ levers[judges].reshape(-1, PARAMETERS).T
        square = left[:, 0::2] ** 2 + left[:, 1::2] ** 2
        cost = np.minimum(square, GATE**2).sum(axis=1) + np.minimum((trials / sigmas) ** 2, MAX_PRIOR_COST).sum(axis=1)
        at = int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))
        if cost[at] < least:
            best, least = np.array(trials[at], np.float64), float(cost[at])
        if np.mean(square[at] < GATE**2) > CLEAR_FRACTION:
            break
    return best


def _trials(random: np.random.Generator, levers: Array, seen: Array, sigmas: Array) -> Array:
    """Parameters through ``SAMPLE`` points each; nods in a sample are not shrunk towards the prior."""
    chosen = random.integers(0, len(levers), (TRIALS, SAMPLE))
    loose = np.where(np.arange(PARAMETERS) >= 3, 10.0 * sigmas, sigmas)
    lever = levers[chosen].reshape(TRIALS, -1, PARAMETERS)
    turned = np.swapaxes(lever, 1, 2)
    right = turned @ seen[chosen].reshape(TRIALS, -1, 1)
    return np.asarray(np.linalg.solve(turned @ lever + np.diag(1.0 / loose**2), right)[..., 0], np.float64)


def _normal(levers: Array) -> Array:
    flat = levers.reshape(-1, PARAMETERS)
    normal: Array = flat.T @ flat
    return normal


def _scatter(white: Array) -> float:
    """Factor by which the residuals' variance exceeds the stated one; at least 1."""
    return max(1.0, float(np.sum(white**2)) / max(1, 2 * len(white) - 5))


def _moved(camera: Camera, motion: Motion, step: Array, covariance: Array, inliers: int) -> tuple[Camera, Motion]:
    """Camera and motion after a correction with this covariance."""
    rotations, translations, ups = perturbed(camera, motion, step[None])
    values, vectors = np.linalg.eigh(covariance)
    spread = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    sigma = float(np.sqrt(covariance[[0, 1], [0, 1]].max())), float(np.sqrt(covariance[2, 2]))
    fixed = Motion(rotations[0], translations[0], motion.origin, inliers, *sigma, spread)
    return replace(camera, up=ups[0]), fixed


def position_slopes(camera: Camera, motion: Motion, current: Array) -> Array:
    """d(previous pixel)/d(parameters), shape (n, 2, 8), of ground seen at current pixels."""
    points = camera.meet_plane(camera.lift(current))
    _, pixels = projection_slopes(camera, motion.apply(points))
    slopes: Array = np.nan_to_num(pixels @ point_slopes(camera, motion, points, on_ground=True))
    return slopes


def predictions(camera: Camera, motion: Motion, current: Array, parameters: Array) -> Array:
    """Previous pixels, shape (v, n, 2), of ground seen at current ones after corrections, shape (v, 8)."""
    rays = camera.lift(current)
    rotations, translations, ups = perturbed(camera, motion, parameters)
    with np.errstate(invalid="ignore", divide="ignore"):
        fall = np.maximum(-(rays @ ups.T).T, 1e-9)
    points = rays * (camera.mounting() / fall)[..., None]
    return camera.project(points @ np.swapaxes(rotations, 1, 2) + translations[:, None])
