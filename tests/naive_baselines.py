"""Slow, obvious twins of the baselines. Imports nothing from ffseg."""

import heapq
import math

import numpy as np
from numpy.typing import NDArray

Node = tuple[int, int]
SIDES = ((-1, 0), (0, -1), (0, 1), (1, 0))


def fast_march(
    speed: NDArray[np.float64], stop: float, inside: NDArray[np.bool_], domain: NDArray[np.bool_]
) -> tuple[dict[Node, float], list[Node], set[Node]]:
    """Sethian's fast marching with one heap: arrival times, nodes in the order they were accepted, on-contour nodes.

    Ties in time go to the node that comes first in raster order. Nodes are (row, column).
    """
    height, width = speed.shape
    times = {(y, x): 0.0 for y in range(height) for x in range(width) if inside[y, x] and domain[y, x]}
    order: list[Node] = []
    on_contour: set[Node] = set()
    heap: list[tuple[float, Node]] = []

    def touch_round(node: Node) -> None:
        for dy, dx in SIDES:
            y, x = node[0] + dy, node[1] + dx
            if not (0 <= y < height and 0 <= x < width) or not domain[y, x] or (y, x) in times:
                continue
            if speed[y, x] <= stop:
                on_contour.add((y, x))
                continue
            a = min(times.get((y, x - 1), math.inf), times.get((y, x + 1), math.inf))
            b = min(times.get((y - 1, x), math.inf), times.get((y + 1, x), math.inf))
            heapq.heappush(heap, (eikonal_root(a, b, 1.0 / float(speed[y, x])), (y, x)))

    for node in list(times):
        touch_round(node)
    while heap:
        time, node = heapq.heappop(heap)
        if node in times:
            continue
        times[node] = time
        order.append(node)
        touch_round(node)
    return times, order, on_contour


def eikonal_root(a: float, b: float, slowness: float) -> float:
    """Larger root of (T - a)^2 + (T - b)^2 = slowness^2, or the one-sided solution where there is none above both."""
    low, high = min(a, b), max(a, b)
    if high - low >= slowness:
        return low + slowness
    return (a + b + math.sqrt(2.0 * slowness**2 - (a - b) ** 2)) / 2.0


def climb(region: set[Node], gradient: NDArray[np.int64], on_contour: set[Node], stop: int, reach: int) -> set[Node]:
    """Nodes at or above `stop` join the region, level by level, while the gradient rises away from it."""
    height, width = gradient.shape
    padded = np.pad(gradient, 1, mode="edge")
    region = set(region)

    def rises(y: int, x: int) -> bool:
        along = 0
        for dy, dx in SIDES:
            if (y - dy, x - dx) in region:
                along += int(padded[y + 1 + dy, x + 1 + dx]) - int(padded[y + 1 - dy, x + 1 - dx])
        return along > 0

    level = set(on_contour)
    for _ in range(reach):
        risen = {node for node in level if rises(*node)}
        region |= risen
        around = {(y + dy, x + dx) for y, x in risen for dy, dx in SIDES}
        level = {
            (y, x)
            for y, x in around
            if 0 <= y < height and 0 <= x < width and gradient[y, x] >= stop and (y, x) not in region
        }
    return region
