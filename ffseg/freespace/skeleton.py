"""Where a robot can drive, as a graph: the medial axis of a map's free cells, at least as wide as the robot."""

from __future__ import annotations

import heapq
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Array, Mask
from ffseg.image.free import nearest_outside
from ffseg.io.files import make_folder, write_all_atomic

Cell = tuple[int, int]
NodeKind = Literal["junction", "end", "frontier"]
MIN_SPREAD = 0.4
"""Metres between the two outlines on either side of a branch: cell steps and small dents form none."""
LINE_WIDTH, FRAME_WIDTH = 0.04, 0.5
"""Metres: width of the lines in the drawing, and of the margin round the graph."""
COLOURS: dict[NodeKind, str] = {"junction": "#2563eb", "end": "#111827", "frontier": "#f59e0b"}
NEIGHBOURS = ((-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1))


@dataclass(frozen=True, slots=True)
class Node:
    """A node: a junction or an end of passages.

    Attributes
    ----------
    x, y : float
        Metres, of the map.
    kind : str
        ``junction``; ``end``; ``frontier``: an end beside ground that nobody has seen.
    clearance_m : float
        Metres to the nearest cell that is not free.

    Examples
    --------
    >>> ffseg.Node(x=1.0, y=2.0, kind="frontier", clearance_m=0.4).kind
    'frontier'
    """

    x: float
    y: float
    kind: NodeKind
    clearance_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A passage between two nodes.

    Attributes
    ----------
    start, end : int
        Numbers of nodes.
    points : ndarray of float64, shape (n, 2)
        Metres.
    length_m, width_m : float
        Of the way, and of the free ground at its narrowest.

    Examples
    --------
    >>> ffseg.Edge(0, 1, np.array([[0.0, 0.0], [1.0, 0.0]]), length_m=1.0, width_m=0.4).points.shape
    (2, 2)
    """

    start: int
    end: int
    points: Array
    length_m: float
    width_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Skeleton:
    """A graph of passages.

    Attributes
    ----------
    nodes : tuple of Node
    edges : tuple of Edge

    Examples
    --------
    >>> import ffseg.freespace.skeleton
    >>> free = np.zeros((24, 40), bool)
    >>> free[2:22, 2:38] = True
    >>> free[10:14, 18:22] = False
    >>> graph = ffseg.freespace.skeleton.skeleton_of(free, np.zeros_like(free), 0.1, (0.0, 0.0), 0.2)
    >>> graph.num_loops
    1
    """

    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]

    @property
    def num_loops(self) -> int:
        """Number of independent loops: one for each free-standing obstacle."""
        part, loops = list(range(len(self.nodes))), 0
        for edge in self.edges:
            own, other = part[edge.start], part[edge.end]
            loops += own == other
            part = [own if one == other else one for one in part]
        return loops

    def geojson(self) -> str:
        """GeoJSON in metres of the map: a Point for each node, a LineString for each edge."""
        features = [
            _feature("Point", [round(one.x, 3), round(one.y, 3)],
                     {"node": number, "kind": one.kind, "clearance_m": round(one.clearance_m, 3)})
            for number, one in enumerate(self.nodes)
        ] + [
            _feature("LineString", one.points.round(3).tolist(),
                     {"start": one.start, "end": one.end, "length_m": round(one.length_m, 3), "width_m": round(one.width_m, 3)})
            for one in self.edges
        ]  # fmt: skip
        return json.dumps({"type": "FeatureCollection", "features": features}, separators=(",", ":"))

    def graphml(self) -> str:
        """GraphML, as networkx and Gephi read it."""
        keys = [("node", "x", "double"), ("node", "y", "double"), ("node", "kind", "string"), ("node", "clearance_m", "double"),
                ("edge", "length_m", "double"), ("edge", "width_m", "double")]  # fmt: skip
        lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">']
        lines += [f'<key id="{n}" for="{of}" attr.name="{n}" attr.type="{kind}"/>' for of, n, kind in keys]
        lines.append('<graph edgedefault="undirected">')
        for number, one in enumerate(self.nodes):
            data = _data(x=one.x, y=one.y, kind=one.kind, clearance_m=one.clearance_m)
            lines.append(f'<node id="n{number}">{data}</node>')
        for number, way in enumerate(self.edges):
            data = _data(length_m=way.length_m, width_m=way.width_m)
            lines.append(f'<edge id="e{number}" source="n{way.start}" target="n{way.end}">{data}</edge>')
        return "\n".join([*lines, "</graph>", "</graphml>", ""])

    def svg(self) -> str:
        """SVG in metres, y up as on the map: lines and circles with titles for edges and nodes."""
        places = np.array([[one.x, one.y] for one in self.nodes]).reshape(-1, 2)
        around = np.concatenate([places, *(edge.points for edge in self.edges)]) if len(places) else np.zeros((1, 2))
        (left, low), (width, height) = around.min(axis=0) - FRAME_WIDTH, np.ptp(around, axis=0) + 2 * FRAME_WIDTH
        view = f"{left:.3f} {-low - height:.3f} {width:.3f} {height:.3f}"
        lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{view}"><g transform="scale(1 -1)">']
        for way in self.edges:
            path = " ".join(f"{x:.3f},{y:.3f}" for x, y in way.points.tolist())
            title = f"<title>{way.length_m:.2f} m long, {way.width_m:.2f} m wide</title>"
            stroke = f'fill="none" stroke="{COLOURS["junction"]}" stroke-width="{LINE_WIDTH}"'
            lines.append(f'<polyline points="{path}" {stroke}>{title}</polyline>')
        for one in self.nodes:
            title = f"<title>{one.kind}, {one.clearance_m:.2f} m clear</title>"
            lines.append(
                f'<circle cx="{one.x:.3f}" cy="{one.y:.3f}" r="{2 * LINE_WIDTH}" fill="{COLOURS[one.kind]}">{title}</circle>'
            )
        return "\n".join([*lines, "</g></svg>", ""])

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``graph.geojson``, ``graph.graphml`` and ``graph.svg``.

        Raises
        ------
        OutputError
            When the folder cannot be written.
        """
        make_folder(folder)
        write_all_atomic([(os.path.join(folder, name), data) for name, data in self.files().items()])

    def files(self) -> dict[str, bytes]:
        """Contents of the files that `save` writes, by name."""
        texts = {"graph.geojson": self.geojson(), "graph.graphml": self.graphml(), "graph.svg": self.svg()}
        return {name: text.encode("utf-8") for name, text in texts.items()}


def skeleton_of(free: Mask, unknown: Mask, cell: float, origin: tuple[float, float], footprint: float) -> Skeleton:
    """The graph of passages over free cells that the robot fits through.

    Parameters
    ----------
    free, unknown : ndarray of bool, shape (rows, columns)
        Rows along y, columns along x.
    cell : float
        Metres.
    origin : tuple of float
        (x, y) of the outer corner of the first cell.
    footprint : float
        Radius of the robot, metres: nearer to what is not free there is no way.

    Notes
    -----
    Cells are taken away from the outlines inward in the order of their distance from them, as long as nothing comes
    apart or together by it; those between outlines farther apart than ``MIN_SPREAD`` stay (the integer medial axis of
    Hesselink and Roerdink, 2008). So the graph has the loops of the ground that the robot's middle may be on.
    """
    far, outside = nearest_outside(free)
    aside = np.abs(np.moveaxis(outside, -1, 0) - np.indices(free.shape))
    room = np.hypot(*np.maximum(aside - 0.5, 0.0)) * cell  # metres to the side or corner of that cell
    drivable = free & (room >= footprint)
    anchors = drivable & _between(outside, max(MIN_SPREAD, footprint) / cell)
    thin = _thinned(_thinned(drivable, far, anchors), far, np.zeros_like(free))
    return _graph(thin, far, room, unknown, cell, origin)


def _between(outside: NDArray[np.intp], spread: float) -> Mask:
    """Cells with a neighbour whose nearest outline is another one."""
    found = np.zeros(outside.shape[:2], np.bool_)
    for nearest, marked in ((outside, found), (outside.swapaxes(0, 1), found.T)):
        apart = np.hypot(*np.moveaxis(np.diff(nearest, axis=0), -1, 0)) > spread
        marked[:-1] |= apart
        marked[1:] |= apart
    return found


def _thinned(cells: Mask, far: NDArray[np.float32], anchors: Mask) -> Mask:
    """Thinning: cells are removed in order of their distance to the outline while the topology is kept.

    Without anchors the ends of ways stay.
    """
    ends, order = not anchors.any(), far.tolist()
    left = {(row, column) for row, column in np.argwhere(cells).tolist()}
    kept = {(row, column) for row, column in np.argwhere(anchors).tolist()}
    queue = [(order[row][column], row, column) for row, column in left - kept]
    heapq.heapify(queue)
    while queue:
        _, row, column = heapq.heappop(queue)
        if (row, column) not in left:
            continue
        pattern = _pattern(left, row, column)
        if not _simple(pattern) or (ends and pattern.bit_count() == 1):
            continue
        left.discard((row, column))
        for down, right in NEIGHBOURS:
            place = row + down, column + right
            if place in left and place not in kept:
                heapq.heappush(queue, (order[place[0]][place[1]], *place))
    found = np.zeros_like(cells)
    if left:
        found[tuple(np.array(sorted(left)).T)] = True
    return found


def _pattern(cells: set[Cell], row: int, column: int) -> int:
    """The eight neighbours of a cell as bits, in the order of `NEIGHBOURS`."""
    return sum(1 << bit for bit, (down, right) in enumerate(NEIGHBOURS) if (row + down, column + right) in cells)


@cache
def _simple(pattern: int) -> bool:
    """Whether a cell with these neighbours is simple: free cells are 8-connected, the others 4-connected.

    The sides that are not free must lie in one run of places that are not, and there must be one.
    """
    runs = 0
    for side in range(1, 8, 2):
        after, beyond = pattern >> (side + 1) % 8 & 1, pattern >> (side + 2) % 8 & 1
        runs += not pattern >> side & 1 and bool(after or beyond)
    return runs == 1


def _graph(
    thin: Mask, far: NDArray[np.float32], room: Array, unknown: Mask, cell: float, origin: tuple[float, float]
) -> Skeleton:
    cells = {(row, column) for row, column in np.argwhere(thin).tolist()}
    beside = {one: _neighbours(one, cells) for one in cells}
    numbers = _numbered(beside)
    groups: dict[int, list[Cell]] = {}
    for one, number in numbers.items():
        groups.setdefault(number, []).append(one)
    nodes = []
    for members in groups.values():
        row, column = np.mean(members, axis=0).tolist()
        first = members[0]
        end = len(members) == 1 and len(beside[first]) <= 1
        kind: NodeKind = ("frontier" if _near(unknown, first, float(far[first])) else "end") if end else "junction"
        x, y = origin[0] + (column + 0.5) * cell, origin[1] + (row + 0.5) * cell
        nodes.append(Node(x, y, kind, float(room[first])))
    edges = []
    for way in _ways(beside, numbers):
        points = (np.array(way)[:, ::-1] + 0.5) * cell + origin
        width = 2.0 * float(min(room[one] for one in way))
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        edges.append(Edge(numbers[way[0]], numbers[way[-1]], points, length, width))
    return Skeleton(tuple(nodes), tuple(edges))


def _near(unknown: Mask, place: Cell, far: float) -> bool:
    """Whether an unknown cell is about as near as the nearest that is not free."""
    (row, column), reach = place, int(far) + 2
    return bool(unknown[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1].any())


def _neighbours(one: Cell, cells: set[Cell]) -> list[Cell]:
    """Neighbours of a cell; over a corner only if no side connects them."""
    row, column = one
    found = [(row + down, column + right) for down, right in NEIGHBOURS[1::2] if (row + down, column + right) in cells]
    for down, right in NEIGHBOURS[::2]:
        if (row + down, column + right) in cells and not {(row + down, column), (row, column + right)} & cells:
            found.append((row + down, column + right))
    return found


def _numbered(beside: dict[Cell, list[Cell]]) -> dict[Cell, int]:
    """Node numbers of cells: ends, connected junctions, one cell of a ring without junction."""
    numbers: dict[Cell, int] = {}
    parts = _parts({one for one in beside if len(beside[one]) > 2}, beside)
    parts += [[one] for one in sorted(beside) if len(beside[one]) < 2]
    for count, part in enumerate(parts):
        numbers |= dict.fromkeys(part, count)
    for part in _parts(set(beside), beside):
        if not numbers.keys() & set(part):
            numbers[min(part)] = max(numbers.values(), default=-1) + 1
    return numbers


def _parts(cells: set[Cell], beside: dict[Cell, list[Cell]]) -> list[list[Cell]]:
    left, found = set(cells), []
    for one in sorted(cells):
        if one in left:
            left.discard(one)
            part, queue = [one], [one]
            while queue:
                near = [place for place in beside[queue.pop()] if place in left]
                left.difference_update(near)
                part += near
                queue += near
            found.append(part)
    return found


def _ways(beside: dict[Cell, list[Cell]], numbers: dict[Cell, int]) -> Iterator[list[Cell]]:
    walked: set[tuple[Cell, Cell]] = set()
    for start in sorted(numbers):
        for second in beside[start]:
            if (start, second) in walked or numbers.get(second) == numbers[start]:
                continue
            way = [start, second]
            while way[-1] not in numbers:
                last, before = way[-1], way[-2]
                way.append(next(one for one in beside[last] if one != before))
            walked |= {(start, second), (way[-1], way[-2])}
            yield way


def _feature(kind: str, coordinates: object, properties: dict[str, object]) -> dict[str, object]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def _data(**values: float | str) -> str:
    texts = {key: value if isinstance(value, str) else f"{value:.3f}" for key, value in values.items()}
    return "".join(f'<data key="{key}">{value}</data>' for key, value in texts.items())
