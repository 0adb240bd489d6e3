"""The graph of ways: loops of known worlds, junctions on the exact medial axis, and its files."""

import json
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from shapely import affinity

from ffseg.freespace.skeleton import NEIGHBOURS, Skeleton, _simple, skeleton_of

CELL = 0.05
FOOTPRINT = 0.15


@lru_cache(maxsize=20)
def world(seed: int) -> tuple[shapely.Polygon, int]:
    """A room with boxes that stand 0.6 m apart from each other and from the walls."""
    random = np.random.default_rng([seed, 77])
    x, y = random.uniform(1.8, 2.6, 2)
    angle = random.uniform(0, 90)
    room = affinity.rotate(shapely.box(-x, -y, x, y), angle)
    boxes: list[shapely.Polygon] = []
    for _ in range(60):
        a, b = random.uniform(0.15, 0.4, 2)
        turned = affinity.rotate(shapely.box(-a, -b, a, b), random.uniform(0, 90))
        box = affinity.translate(turned, *random.uniform(-x, x, 2))
        if room.buffer(-0.6).contains(box) and all(box.distance(one) > 0.6 for one in boxes) and len(boxes) < 4:
            boxes.append(box)
    return room.difference(shapely.union_all(boxes)), len(boxes)


def made(ground: shapely.Polygon, footprint: float = FOOTPRINT) -> Skeleton:
    low = np.floor(np.array(ground.bounds[:2]) / CELL).astype(int) - 2
    high = np.ceil(np.array(ground.bounds[2:]) / CELL).astype(int) + 2
    x, y = np.meshgrid(*((np.arange(a, b) + 0.5) * CELL for a, b in zip(low, high, strict=True)))
    free = shapely.contains_xy(ground, x, y)
    return skeleton_of(free, np.zeros_like(free), CELL, (float(low[0] * CELL), float(low[1] * CELL)), footprint)


def medial_axis(ground: shapely.Polygon) -> shapely.MultiPoint:
    """Vertices of the Voronoi diagram of the outline, every 2 cm, that lie in the ground."""
    points = shapely.get_coordinates(shapely.segmentize(ground.boundary, 0.02))
    diagram = shapely.voronoi_polygons(shapely.MultiPoint(points), only_edges=True)
    found = np.unique(shapely.get_coordinates(diagram), axis=0)
    return shapely.MultiPoint(found[shapely.contains_xy(ground.buffer(-0.01), found[:, 0], found[:, 1])])


@pytest.mark.parametrize("seed", range(20))
def test_one_loop_for_each_box_and_junctions_on_the_medial_axis(seed: int) -> None:
    """Junctions lie within 10 cm, two cells, of the axis that Voronoi's diagram has."""
    ground, boxes = world(seed)
    graph = made(ground)
    assert graph.num_loops == boxes
    axis = medial_axis(ground)
    places = [shapely.Point(one.x, one.y) for one in graph.nodes if one.kind == "junction"]
    assert max((place.distance(axis) for place in places), default=0.0) <= 0.10
    for edge in graph.edges:
        assert shapely.LineString(edge.points).within(ground.buffer(-FOOTPRINT + 0.75 * CELL))
        assert edge.width_m >= 2 * FOOTPRINT


def test_what_the_robot_cannot_drive_is_no_way() -> None:
    """Two rooms and a door 0.4 m wide."""
    rooms = shapely.box(0, 0, 2, 3).union(shapely.box(2.2, 0, 4.2, 3)).union(shapely.box(1.9, 1.3, 2.3, 1.7))

    def parts(graph: Skeleton) -> int:
        return len(graph.nodes) - len(graph.edges) + graph.num_loops

    assert parts(made(rooms, 0.1)) == 1
    assert min(edge.width_m for edge in made(rooms, 0.1).edges) == pytest.approx(0.4, abs=1.01 * CELL)
    assert parts(made(rooms, 0.21)) == 2, "it went through doors a cell narrower than itself"


def test_an_end_beside_what_nobody_has_seen_is_a_frontier() -> None:
    """A corridor that ends at a wall on one side and goes on unseen on the other."""
    free = np.zeros((20, 80), np.bool_)
    free[4:16, 4:76] = True
    unknown = np.zeros_like(free)
    unknown[:, 76:] = True
    graph = skeleton_of(free, unknown, CELL, (0.0, 0.0), 0.1)
    ends = [node for node in graph.nodes if node.kind != "junction"]
    assert {node.kind for node in ends if node.x < 1.0} == {"end"}
    assert "frontier" in {node.kind for node in ends if node.x > 3.0}


def parts_of(places: set[tuple[int, int]], corners: bool) -> int:
    count, left = 0, set(places)
    while left:
        queue, count = [left.pop()], count + 1
        while queue:
            row, column = queue.pop()
            near = {(row + d, column + r) for d, r in NEIGHBOURS if corners or d == 0 or r == 0} & left
            left -= near
            queue += near
    return count


def test_a_cell_is_simple_where_nothing_comes_apart_or_together() -> None:
    """All 256 neighbourhoods against counts of components before and after."""
    whole = {(row, column) for row in range(-2, 3) for column in range(-2, 3)}
    for pattern in range(256):
        without = {place for bit, place in enumerate(NEIGHBOURS) if pattern >> bit & 1}
        within = without | {(0, 0)}
        same = parts_of(within, True) == parts_of(without, True)
        same &= parts_of(whole - within, False) == parts_of(whole - without, False)
        assert _simple(pattern) == (same and bool(without)), bin(pattern)


def test_files_hold_the_graph(tmp_path: Path) -> None:
    graph = made(world(1)[0])
    graph.save(tmp_path)
    features = json.loads((tmp_path / "graph.geojson").read_text())["features"]
    kinds = [feature["geometry"]["type"] for feature in features]
    assert (kinds.count("Point"), kinds.count("LineString")) == (len(graph.nodes), len(graph.edges))
    space = "{http://graphml.graphdrawing.org/xmlns}"
    root = ElementTree.fromstring((tmp_path / "graph.graphml").read_text())  # noqa: S314 - our own file
    names = {one.get("id") for one in root.iter(f"{space}node")}
    ends = {one.get(side) for one in root.iter(f"{space}edge") for side in ("source", "target")}
    declared = {one.get("id") for one in root.iter(f"{space}key")}
    assert len(names) == len(graph.nodes)
    assert ends <= names
    assert {one.get("key") for one in root.iter(f"{space}data")} <= declared
    drawn = ElementTree.fromstring((tmp_path / "graph.svg").read_text())  # noqa: S314 - our own file
    left, top, width, height = map(float, drawn.get("viewBox", "").split())
    circles = [(float(one.get("cx")), float(one.get("cy"))) for one in drawn.iter("{http://www.w3.org/2000/svg}circle")]
    assert circles == [pytest.approx((one.x, one.y), abs=0.001) for one in graph.nodes]
    assert all(left < x < left + width and top < -y < top + height for x, y in circles)
