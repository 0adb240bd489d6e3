"""Scenes that ask the free form for something hard each: narrow ways, textures, islands with noise, drawings."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

import ffseg
from ffseg.learning.drawn.sights import Sight, sights
from ffseg.metrics import iou
from tests import labyrinths, stress
from tests.campaigns import corridors
from tests.property.test_filled_once import front, texture

NARROW, PASSAGES = (6.5, 7.0, 8.0, 10.0), (*range(100), 404, 412, 7222, 8833)
"""Widths of labyrinths, px, and seeds of drawn passages."""
DRAWN = {"nuclei": 40, "tissue": 10, "colony": 10, "organ": 10, "field": 10}
"""Numbers of drawings."""
Settings = Mapping[str, object]


def scenes(settings: Settings) -> Iterator[tuple[str, Callable[[], float]]]:
    """Names, and what gives the IoU of each; 0 where the evolution does not come to rest or contours cross."""
    for kind in ("spiral", "maze", "comb"):
        for width in NARROW:
            plan = labyrinths.Plan(kind, 3, 17.0, width + 12)
            yield f"{kind} of {width:g} px", partial(_narrow, plan, width, settings)
    for seed in PASSAGES:
        plan, width, own = corridors.plan_of(seed)
        name = f"passage {seed}, {width:g} px, degree {own['contour.degree']}"
        yield name, partial(_narrow, plan, width, {**own, **settings})
    for seed in range(100):
        yield f"random scene {seed}", partial(_random, seed, settings)
    for seed in range(24):
        yield f"texture {seed}", partial(_texture, seed)
    for kind, count in DRAWN.items():
        for number, seen in enumerate(sights(kind, count)):
            yield f"drawing `{kind}` {number}", partial(_drawing, seen, settings)


def _narrow(plan: labyrinths.Plan, width: float, settings: Settings) -> float:
    scene = plan.drawn(width)
    found = corridors.segmented(scene, settings)
    return _at_rest(found) * corridors.iou_off_border(found.mask, scene.truth)


def _random(seed: int, settings: Settings) -> float:
    found = stress.check(seed, dict(settings))
    return 0.0 if "contours cross" in found.faults else found.iou


def _texture(seed: int) -> float:
    made = front(texture(seed, 300), (150.0, 150.0), 10.0)
    made.advance(5001)
    return float(made.stop_reason == "converged")


def _drawing(seen: Sight, settings: Settings) -> float:
    x, y, radius = seen.start
    own = {"init.center": [x, y], "init.radius": radius, "edges.source": "gradient"}
    found = ffseg.segment(seen.image, {**own, **settings})
    return _at_rest(found) * iou(found.mask, seen.truth)


def _at_rest(found: ffseg.Segmentation) -> bool:
    return found.stats.stop_reason == "converged"
