"""The paper's Algorithms 1 to 4 as printed, on plain lists; a patch is a list of control points, a component of patches.

Imports nothing from ffseg. Where the print leaves something open or cannot work, a note "Reading" says what is done.
"""

from itertools import pairwise
from math import hypot

from naive import bezier_point, interpolate, turn

Point = tuple[float, float]
Patch = list[Point]
Component = list[Patch]
Place = tuple[int, int]  # of a component, and of a patch in it


def tangent(points: Patch, t: float) -> Point:
    d = len(points) - 1
    return bezier_point([(d * (bx - ax), d * (by - ay)) for (ax, ay), (bx, by) in pairwise(points)], t)


def spread(points: Patch) -> float:
    return max(hypot(ax - bx, ay - by) for ax, ay in points for bx, by in points)


def split(components: list[Component], threshold: float) -> list[Component]:
    """Algorithm 2."""
    made = []
    for component in components:
        new = []
        for patch in component:
            d = len(patch) - 1
            if spread(patch) > threshold:
                new.append(interpolate([bezier_point(patch, i / (2 * d)) for i in range(d + 1)]))
                new.append(interpolate([bezier_point(patch, (i + d) / (2 * d)) for i in range(d + 1)]))
            else:
                new.append(patch)
        made.append(new)
    return made


def prune(components: list[Component], threshold: float) -> list[Component]:
    """Footnote of Section 3.3: two adjacent patches become one, which keeps every second control point.

    Reading: where all their control points together lie within half the threshold; a component keeps two patches.
    """
    made = []
    for component in components:
        new, rest, left = list[Patch](), list(component), len(component)
        while rest:
            first = rest.pop(0)
            if rest and left > 2 and spread(first + rest[0]) < threshold / 2:
                first = (first + rest.pop(0)[1:])[::2]
                left -= 1
            new.append(first)
        made.append(new)
    return made


Box = tuple[float, float, float, float]


def box_of(patch: Patch) -> Box:
    xs, ys = [x for x, _ in patch], [y for _, y in patch]
    return min(xs), min(ys), max(xs), max(ys)


def box_inter(b1: Box, b2: Box) -> bool:
    """BoxInter of Section 3.4 as printed: along y boxes are compared only where their sides along x are equal."""
    (x1, y1, x2, y2), (x3, y3, x4, y4) = b1, b2
    if x2 < x3 or (x2 == x3 and (y2 < y3 or y4 < y1)):
        return False
    return not (x4 < x1 or (x4 == x1 and (y4 < y1 or y2 < y3)))


def crossings(p: Patch, q: Patch) -> int:
    """Proper crossings of two control polygons."""
    return sum(cross(a, b, c, d) for a, b in pairwise(p) for c, d in pairwise(q))


def cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    return turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0


def pairs(components: list[Component]) -> list[tuple[Place, Place]]:
    """Places of all patches that are not adjacent, in the order of their boxes, whose boxes may meet."""
    entries = sorted((box_of(patch), (c, i)) for c, own in enumerate(components) for i, patch in enumerate(own))
    found = []
    for at, (box, a) in enumerate(entries):
        for other, b in entries[at + 1 :]:
            n = len(components[a[0]])
            adjacent = a[0] == b[0] and (a[1] - b[1]) % n in (1, n - 1)
            if box_inter(box, other) and not adjacent:
                found.append((min(a, b), max(a, b)))
    return found


def exchanged(p: Patch, q: Patch) -> tuple[Patch, Patch]:
    """Algorithm 3's new patches. Reading: the second as it connects, [P_0j .. P_kj, P_(k+1)i .. P_di]."""
    k = (len(p) - 1) // 2
    return p[: k + 1] + q[k + 1 :], q[: k + 1] + p[k + 1 :]


def turned(component: Component) -> Component:
    return [patch[::-1] for patch in component[::-1]]


def area(component: Component) -> float:
    """Of the control polygon."""
    points = [point for patch in component for point in patch[:-1]]
    return sum(ax * by - bx * ay for (ax, ay), (bx, by) in zip(points, points[1:] + points[:1], strict=True)) / 2


def flip_pair(components: list[Component], inner: list[Component], a: Place, b: Place) -> bool:
    """Algorithm 3 for one pair. Reading: what is cut off is the part that encloses less; it does not go on."""
    (c, i), (e, j) = a, b
    first, second = components[c], components[e]
    if crossings(first[i], second[j]) == 0:
        return False
    p, q = exchanged(first[i], second[j])
    if crossings(p, q) > 0:  # Remark: orientations that are not compatible
        if c == e or crossings(first[i], second[j]) != 2:
            return False
        second, j = turned(second), len(second) - 1 - j
        p, q = exchanged(first[i], second[j])
        if crossings(p, q) > 0:
            return False
    if c == e:
        parts = [first[:i] + [p] + first[j + 1 :], [q] + first[i + 1 : j]]
        out = parts[0] if abs(area(parts[1])) <= abs(area(parts[0])) else parts[1]
        inner.append(parts[1] if out is parts[0] else parts[0])
        components[c] = out
    else:
        components[c] = first[:i] + [p] + second[j + 1 :] + second[:j] + [q] + first[i + 1 :]
        del components[e]
    return True


def flip(components: list[Component], inner: list[Component]) -> int:
    """Algorithm 3 until nothing flips. Reading: at most as many flips as there were patches. How many there were."""
    most = sum(map(len, components))
    for done in range(most):
        if not any(flip_pair(components, inner, a, b) for a, b in pairs(components)):
            return done
    return most


class Field:
    """The edge map as rows of numbers: gradient in grey levels per px, edges, and where the contour may go."""

    def __init__(self, gradient: list[list[float]], edges: list[list[bool]], domain: list[list[bool]]) -> None:
        self.gradient_rows, self.edges, self.domain = gradient, edges, domain
        self.height, self.width = len(gradient), len(gradient[0])

    def gradient(self, p: Point) -> float:
        x, y = min(max(p[0], 0), self.width - 1), min(max(p[1], 0), self.height - 1)
        u, v = int(x), int(y)
        corners = [(u, v, (1 - x + u) * (1 - y + v)), (u + 1, v, (x - u) * (1 - y + v))]
        corners += [(u, v + 1, (1 - x + u) * (y - v)), (u + 1, v + 1, (x - u) * (y - v))]
        return sum(w * self.gradient_rows[min(b, self.height - 1)][min(a, self.width - 1)] for a, b, w in corners)

    def homogeneous(self, p: Point) -> bool:
        if not self.allowed(p):
            return False
        column, row = int(p[0] + 0.5), int(p[1] + 0.5)
        near = [(u, v) for u in (column - 1, column, column + 1) for v in (row - 1, row, row + 1)]
        return not any(self.edges[v][u] for u, v in near if 0 <= u < self.width and 0 <= v < self.height)

    def allowed(self, p: Point) -> bool:
        inside = 0 <= p[0] <= self.width - 1 and 0 <= p[1] <= self.height - 1
        return inside and self.domain[int(p[1] + 0.5)][int(p[0] + 0.5)]


def deformation(field: Field, at: Point, normal: Point, balloon: float, exponent: float, sigma: float) -> float:
    """Section 3.2: how far a sample goes along its normal.

    Reading: "only in the homogeneous domains" is off the eight neighbours of an edge pixel, where the sample climbs the
    logarithm of the edge force; a smoothed step has its ridge at sigma^2 times that slope, and no step exceeds 1 px.
    """
    if field.homogeneous(at):
        return balloon / (1 + field.gradient(at) ** exponent)  # Eq. 8
    ahead, behind = ((at[0] + s * normal[0], at[1] + s * normal[1]) for s in (1, -1))
    level = field.gradient(at)
    slope = (field.gradient(ahead) - field.gradient(behind)) / 2
    return min(1.0, max(-1.0, sigma**2 * slope / level)) if level > 0 else 0.0


def unit(v: Point) -> Point:
    size = hypot(*v)
    return (v[0] / size, v[1] / size) if size > 0 else (0.0, 0.0)


def move(components: list[Component], field: Field, balloon: float, exponent: float, sigma: float) -> tuple[int, int]:
    """Deform every patch (Eq. 7). Reading: a joint takes the mean normal of its two patches, or the contour would open."""
    moving = samples = 0
    for component in components:
        d = len(component[0]) - 1
        ways: list[list[Point]] = []
        for i, patch in enumerate(component):
            way = []
            for k in range(d):
                along = tangent(patch, k / d)
                if k == 0:
                    a, b = unit(along), unit(tangent(component[i - 1], 1.0))
                    along = a[0] + b[0], a[1] + b[1]
                along = unit(along)
                at, normal = bezier_point(patch, k / d), (along[1], -along[0])
                size = deformation(field, at, normal, balloon, exponent, sigma)
                to = at[0] + size * normal[0], at[1] + size * normal[1]
                way.append((size * normal[0], size * normal[1]) if field.allowed(to) else (0.0, 0.0))
                moving += hypot(*way[-1]) >= 0.1
                samples += 1
            ways.append(way)
        for i, way in enumerate(ways):
            delta = interpolate([*way, ways[(i + 1) % len(ways)][0]])
            component[i] = [(x + dx, y + dy) for (x, y), (dx, dy) in zip(component[i], delta, strict=True)]
    return moving, samples
