"""The parametric snake (PM), the paper's parametric rival: parameters and values round the native core."""

from __future__ import annotations

import numpy as np

from ffseg.arrays import Points
from ffseg.errors import SegmentationError
from ffseg.geometry.freeform import FreeForm
from ffseg.methods.effort import budget, evolve, iterations
from ffseg.native import _core
from ffseg.scene import MAX_MARCHING_SIDE, Outcome, Progress, Scene, Stats, check_sides

START_SPACING = 0.75
"""Distance of the first points in units of ``snake.spacing``: half-way between a split and what a split leaves."""

MIN_POINTS = 8

WORK = 16
"""Points moved to a pixel of the domain, at most. Measured: 1.8 in labyrinths; on photographs whose edges hold the snake loosely
it creeps, in one of four longer than this."""


def run(scene: Scene) -> Outcome:
    """Evolve one closed snake until it rests (Eq. 10, Section 5.1).

    Parameters
    ----------
    scene : Scene
        With exactly one start. Of its parameters ``snake``; of ``contour`` the keys ``balloon``, ``refine`` and
        ``max_iterations``; ``obstacles.altitude``.

    Returns
    -------
    Outcome
        One polygon (degree 1), or none when the snake has vanished; ``splits`` counts inserted points, ``prunes``
        removed ones.

    Raises
    ------
    SegmentationError
        If there is more than one start contour.

    Notes
    -----
    Kass's internal energy, solved implicitly: (I + A) v' = v + F. In homogeneous parts F is the balloon (Cohen), as
    long as no other stretch of the snake is met; round Canny edges it is ``attraction * grad ln |grad I|`` along the
    normal, which for an edge blurred with sigma^2 = ``attraction`` points at the ridge with the right length.
    Points of ``scene.altitudes`` below ``obstacles.altitude`` switch edges off in their zones, others double the force
    (Eq. 11); where both lie near, the edge stands.
    Differs: the paper's external energy is the gradient magnitude itself; its logarithm has the same minima but
    does not depend on the contrast. The one contour does not split: round an island it closes to a slit.
    """
    check_sides(scene.image.shape, MAX_MARCHING_SIDE, "method snake")
    edge_map, starts, params = scene.edges, scene.starts, scene.params
    if len(starts) != 1:
        raise SegmentationError(
            f"the snake is one closed contour, but {len(starts)} starts are given; give one, or use method freeform"
        )
    snake = _core.Snake(
        _points(starts[0], params.snake.spacing),
        edge_map.gradient,
        edge_map.edges,
        edge_map.domain,
        np.ascontiguousarray(scene.altitudes, dtype=np.float64),
        params.obstacles.altitude,
        _options(scene),
    )
    initial = len(snake.points())
    evolve(snake.advance, scene, lambda: Progress(snake.iterations, _contours(snake)))
    contours = _contours(snake)
    if scene.callback is not None:
        scene.callback(Progress(snake.iterations, contours))
    return Outcome(contours, _stats(snake, initial))


def _points(start: FreeForm, spacing: float) -> Points:
    """Equidistant points along the start contour."""
    polygon = start.flatten()
    closed = np.concatenate([polygon, polygon[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    count = max(MIN_POINTS, round(at[-1] / (START_SPACING * spacing)))
    spaced = np.arange(count) * (at[-1] / count)
    return np.stack([np.interp(spaced, at, closed[:, axis]) for axis in (0, 1)], axis=1)


def _options(scene: Scene) -> _core.SnakeOptions:
    params, options = scene.params, _core.SnakeOptions()
    options.tension = params.snake.tension
    options.rigidity = params.snake.rigidity
    options.attraction = params.snake.attraction
    options.spacing = params.snake.spacing
    options.tolerance = params.snake.tolerance
    options.balloon = params.contour.balloon
    options.refine = params.contour.refine
    options.max_iterations, options.budget = iterations(params), budget(scene, WORK)
    return options


def _contours(snake: _core.Snake) -> tuple[FreeForm, ...]:
    return () if snake.stop_reason == "vanished" else (FreeForm(snake.points(), 1),)


def _stats(snake: _core.Snake, initial: int) -> Stats:
    final = sum(len(c.control_points) for c in _contours(snake))
    return Stats(
        iterations=snake.iterations,
        splits=snake.insertions,
        prunes=snake.removals,
        initial_points=initial,
        final_points=final,
        patches=final,
        stop_reason=snake.stop_reason,
    )
