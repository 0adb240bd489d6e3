"""Where the contours of one result cross themselves or each other, decided exactly: what no result may do.

Ties are broken by Edelsbrunner and Muecke's simulation of simplicity: every vertex, known by its index, counts as moved by
its own infinitesimal amount, consistently over all calls.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ffseg.geometry.bezier import Points
from ffseg.geometry.freeform import FreeForm
from ffseg.geometry.orientation import Signs, signs_of_turns

Indices = NDArray[np.int64]

CROSSING_TOLERANCE = 0.01
"""Pixels: a hundredth of a pixel shows neither in a mask nor in a picture."""

_PAIRS_AT_ONCE = 1_000_000
"""Edge pairs looked at together: bounds the memory (about 200 bytes a pair), not the result."""


def signed_area(vertices: Points) -> float:
    """Shoelace area of a closed polygon, shape (M, 2), first vertex not repeated; 0 for fewer than three vertices."""
    local = vertices - vertices[:1]
    x, y = local[:, 0], local[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@dataclass(frozen=True, slots=True)
class Crossing:
    """A point where two stretches of contour cross.

    Attributes
    ----------
    x, y : float
        Pixels.
    first, second : tuple of int
        (contour, patch) of both stretches, the smaller first.
    """

    x: float
    y: float
    first: tuple[int, int]
    second: tuple[int, int]


def self_intersections(contours: Sequence[FreeForm | Points], tolerance: float = CROSSING_TOLERANCE) -> list[Crossing]:
    """Where the contours of one result cross themselves or each other.

    Parameters
    ----------
    contours : sequence of FreeForm or of ndarray of float64, shape (M, 2)
        Polygons are closed, the first vertex not repeated.
    tolerance : float
        Pixels, > 0.

    Returns
    -------
    list of Crossing
        In order of contour and patch; empty if there is none.

    Raises
    ------
    ValueError
        If the tolerance is not positive or a polygon is not a legal contour.

    Notes
    -----
    Crossings deeper than `tolerance` are reported, and none where the curves do not cross. Stretches that only touch,
    or run along each other, or overlap by at most half of it, do not count, nor does a loop so thin; in between either
    answer may come. The curves are flattened within a quarter of the tolerance; crossings of the polygons are found
    exactly, ties broken by simulated perturbation; then lenses (two stretches between two crossings) and loops (out and
    back) whose sides lie within half the tolerance of each other are taken away. Limit: a contour folded onto itself
    more than once along one line may be reported.
    """
    chains = _Chains.of(contours, tolerance / 4.0)
    first, second = _crossing_edges(chains)
    visits = _Visits.of(chains, first, second)
    kept = visits.without_shallow(chains, tolerance / 2.0)
    return sorted((visits.crossing(chains, k) for k in kept), key=lambda c: (c.first, c.second, c.x, c.y))


@dataclass(frozen=True, slots=True, eq=False)
class _Chains:
    """All polygons in one array; edge e runs from vertex e to vertex ``successor[e]`` of the same contour."""

    vertices: Points
    successor: Indices
    contour: Indices
    patch: Indices
    begin: Indices

    @classmethod
    def of(cls, contours: Sequence[FreeForm | Points], tolerance: float) -> _Chains:
        vertices, patch, successor, begin = [], [], [], [0]
        for contour in contours:
            curve = contour if isinstance(contour, FreeForm) else FreeForm.polygon(contour)
            points, owner = _without_repeats(*curve.flatten_indexed(tolerance))
            vertices.append(points)
            patch.append(owner)
            successor.append(begin[-1] + np.roll(np.arange(len(points)), -1))
            begin.append(begin[-1] + len(points))
        ends = np.array(begin)
        return cls(
            np.concatenate([np.empty((0, 2)), *vertices]),
            np.concatenate([np.empty(0, np.int64), *successor]),
            np.repeat(np.arange(len(contours)), np.diff(ends)),
            np.concatenate([np.empty(0, np.int64), *patch]),
            ends,
        )

    def stretch(self, start: tuple[int, float], end: tuple[int, float]) -> Points:
        """Vertices from one place (edge, fraction) of a contour onward to another, both places included."""
        contour = self.contour[start[0]]
        first, size = self.begin[contour], self.begin[contour + 1] - self.begin[contour]
        count = (end[0] - start[0]) % size
        if count == 0 and end[1] < start[1]:
            count = size
        between = first + (start[0] - first + 1 + np.arange(count)) % size
        return np.concatenate([[self.at(*start)], self.vertices[between], [self.at(*end)]])

    def at(self, edge: int, fraction: float) -> Points:
        """Point of an edge."""
        a, b = self.vertices[edge], self.vertices[self.successor[edge]]
        point: Points = a + fraction * (b - a)
        return point


def _without_repeats(points: Points, owner: NDArray[np.int64]) -> tuple[Points, NDArray[np.int64]]:
    """Drop vertices that repeat the one before them; a contour that is one point keeps one vertex."""
    moved = (points != np.roll(points, 1, axis=0)).any(axis=1)
    moved[0] |= not moved.any()
    return points[moved], owner[moved]


def _crossing_edges(chains: _Chains) -> tuple[Indices, Indices]:
    """Pairs of edges without common vertex that cross after the simulated perturbation."""
    found = [np.empty((2, 0), np.int64)]
    for pair in _close_pairs(chains):
        a, c = pair[:, _apart(chains, *pair)]
        b, d = chains.successor[a], chains.successor[c]
        vertices = chains.vertices
        crossed = orientation(vertices, a, b, c) != orientation(vertices, a, b, d)
        a, b, c, d = a[crossed], b[crossed], c[crossed], d[crossed]
        crosses = orientation(vertices, c, d, a) != orientation(vertices, c, d, b)
        found.append(np.stack([a[crosses], c[crosses]]))
    first, second = np.concatenate(found, axis=1)
    return first, second


def _apart(chains: _Chains, a: Indices, c: Indices) -> NDArray[np.bool_]:
    """Whether edges a and c have four different vertices."""
    b, d = chains.successor[a], chains.successor[c]
    apart: NDArray[np.bool_] = (a != d) & (b != c) & (a != b) & (c != d)
    return apart


def _close_pairs(chains: _Chains) -> Iterator[Indices]:
    """Pairs of edges whose boxes meet, in batches: sweep along the axis that leaves fewer pairs."""
    ends = np.stack([chains.vertices, chains.vertices[chains.successor]])
    low, high = ends.min(axis=0), ends.max(axis=0)
    sweeps = [_sweep(low[:, axis], high[:, axis]) for axis in (0, 1)]
    axis = int(sweeps[1][1].sum() < sweeps[0][1].sum())
    order, counts = sweeps[axis]
    total = np.concatenate([[0], np.cumsum(counts)])
    position = 0
    while position < len(order):
        stop = int(max(np.searchsorted(total, total[position] + _PAIRS_AT_ONCE, side="right") - 1, position + 1))
        here = np.repeat(np.arange(position, stop), counts[position:stop])
        there = here + 1 + np.arange(len(here)) - (total[here] - total[position])
        a, b = order[here], order[there]
        meets = (low[a, 1 - axis] <= high[b, 1 - axis]) & (low[b, 1 - axis] <= high[a, 1 - axis])
        yield np.stack([a[meets], b[meets]])
        position = stop


def _sweep(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[Indices, Indices]:
    """Order of the intervals by their low end, and how many of those after each begin within it."""
    order = np.argsort(low, kind="stable")
    counts = np.searchsorted(low[order], high[order], side="right") - np.arange(len(low)) - 1
    return order, counts


@dataclass(frozen=True, slots=True, eq=False)
class _Visits:
    """Crossings as places (edge, fraction) on the chains; crossing k is visited at places 2k and 2k + 1."""

    edge: Indices
    fraction: NDArray[np.float64]

    @classmethod
    def of(cls, chains: _Chains, first: Indices, second: Indices) -> _Visits:
        edge = np.stack([first, second], axis=1)
        swapped = edge[:, ::-1]
        fraction = np.stack([_fractions(chains, *pair.T) for pair in (edge, swapped)], axis=1)
        return cls(edge.ravel(), fraction.ravel())

    def place(self, visit: int) -> tuple[int, float]:
        return int(self.edge[visit]), float(self.fraction[visit])

    def crossing(self, chains: _Chains, number: int) -> Crossing:
        edges = self.edge[2 * number : 2 * number + 2]
        x, y = chains.at(*self.place(2 * number))
        first, second = sorted((int(chains.contour[e]), int(chains.patch[e])) for e in edges)
        return Crossing(float(x), float(y), first, second)

    def without_shallow(self, chains: _Chains, depth: float) -> list[int]:
        """Numbers of the crossings left when loops and lenses up to `depth` are taken away, innermost first."""
        left = set(range(len(self.edge) // 2))
        order = [int(v) for v in np.lexsort((self.fraction, self.edge))]
        while True:
            order = [v for v in order if v // 2 in left]
            gone = self._shallow(chains, order, depth)
            if not gone:
                return sorted(left)
            left -= gone

    def _shallow(self, chains: _Chains, order: list[int], depth: float) -> set[int]:
        following = dict(self._steps(chains, order))
        gone: set[int] = set()
        for here, there in following.items():
            pair = {here // 2, there // 2}
            if not pair & gone and self._is_shallow(chains, following, (here, there), depth):
                gone |= pair
        return gone

    def _steps(self, chains: _Chains, order: list[int]) -> Iterator[tuple[int, int]]:
        """Each visit with the next one on the same contour, round the end."""
        contours = [int(chains.contour[self.edge[v]]) for v in order]
        start = 0
        for position, visit in enumerate(order):
            last = position + 1 == len(order) or contours[position + 1] != contours[position]
            yield visit, order[start if last else position + 1]
            start = position + 1 if last else start

    def _is_shallow(self, chains: _Chains, following: dict[int, int], step: tuple[int, int], depth: float) -> bool:
        here, there = step
        one = chains.stretch(self.place(here), self.place(there))
        if here // 2 == there // 2:
            return _is_thin(one, depth)
        for a, b in ((here ^ 1, there ^ 1), (there ^ 1, here ^ 1)):
            if following.get(a) == b and {a, b} != {here, there}:
                other = chains.stretch(self.place(a), self.place(b))
                if _within(one, other, depth):
                    return True
        return False


def _fractions(chains: _Chains, edge: Indices, other: Indices) -> NDArray[np.float64]:
    """Where along `edge` it meets `other`, 0..1; the middle of the common stretch of edges in line."""
    a, b = chains.vertices[edge], chains.vertices[chains.successor[edge]]
    c, d = chains.vertices[other], chains.vertices[chains.successor[other]]
    along, across = b - a, d - c
    slope = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    offset = (c - a)[:, 0] * across[:, 1] - (c - a)[:, 1] * across[:, 0]
    size = (along**2).sum(axis=1)
    ends = np.clip(np.stack([((p - a) * along).sum(axis=1) / size for p in (c, d)]), 0.0, 1.0)
    fraction = np.divide(offset, slope, out=ends.mean(axis=0), where=slope != 0.0)
    clipped: NDArray[np.float64] = np.clip(fraction, 0.0, 1.0)
    return clipped


def _is_thin(loop: Points, depth: float) -> bool:
    """Whether the way out to the loop's farthest vertex and the way back stay within `depth` of each other."""
    tip = max(int(np.hypot(*(loop - loop[0]).T).argmax()), 1)
    return _within(loop[: tip + 1], loop[tip:], depth)


def _within(one: Points, other: Points, depth: float) -> bool:
    """Whether no vertex of either chain is farther than `depth` from the other chain."""
    boxes = np.array([[p.min(axis=0), p.max(axis=0)] for p in (one, other)])
    if np.abs(boxes[0] - boxes[1]).max() > depth:
        return False
    return all(_farthest(p, q) <= depth for p, q in ((one, other), (other, one)))


def _farthest(points: Points, chain: Points) -> float:
    """Largest distance of the points from an open chain of two vertices or more."""
    start, along = chain[:-1], np.diff(chain, axis=0)
    size = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    to_point = points[:, None] - start
    t = np.clip((to_point * along).sum(axis=-1) / size, 0.0, 1.0)
    gap = to_point - t[..., None] * along
    return float(np.hypot(gap[..., 0], gap[..., 1]).min(axis=1).max())


def orientation(vertices: Points, i: Indices, j: Indices, k: Indices) -> Signs:
    """Turning sense of the triples of vertices i, j, k; never 0.

    Parameters
    ----------
    vertices : ndarray of float64, shape (M, 2)
        Within about 1e-140 to 1e140 in size, or zero.
    i, j, k : ndarray of int64, shape (n,)
        Three different indices each.

    Returns
    -------
    ndarray of int8, shape (n,)
        Sign of (p_j - p_i) x (p_k - p_i): +1 turns from x toward y. Triples exactly in line, and points that coincide,
        get the sign of the simulated perturbation.
    """
    a, b, c = vertices[i], vertices[j], vertices[k]
    signs = signs_of_turns(a, b, c)
    tied = np.flatnonzero(signs == 0)
    signs[tied] = _perturbed_signs(vertices, np.stack([i[tied], j[tied], k[tied]], axis=-1))
    return signs


def _perturbed_signs(vertices: Points, triples: Indices) -> Signs:
    """Signs of triples exactly in line: the first term of the perturbed determinant that is not zero.

    With indices sorted, i moves most, along x before y; the terms in order are
    y_j - y_k, x_k - x_j, y_k - y_i and -1.
    """
    order = np.argsort(triples, axis=1)
    odd = ((order[:, 0] > order[:, 1]) ^ (order[:, 0] > order[:, 2]) ^ (order[:, 1] > order[:, 2])).astype(bool)
    first, second, third = (vertices[column] for column in np.sort(triples, axis=1).T)
    sign = np.sign(second[:, 1] - third[:, 1])
    for term in (third[:, 0] - second[:, 0], third[:, 1] - first[:, 1], np.full(len(triples), -1.0)):
        sign = np.where(sign == 0, np.sign(term), sign)
    turned: Signs = np.where(odd, -sign, sign).astype(np.int8)
    return turned
