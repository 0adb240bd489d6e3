"""The parameter set: the only home of defaults."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

from ffseg.plugins import EDGE_SOURCES, METHODS, installed
from ffseg.schema.kinds import FilePath, Flag, Integer, Many, Name, Number, OrWord, Row, Text
from ffseg.schema.sections import Section, declared, subsection

Point = tuple[float, float]
Circle = tuple[float, float, float]
Box = tuple[float, float, float, float]
Seed = tuple[float, float] | tuple[float, float, float] | tuple[float, float, float, float]
"""A point (x, y) or circle (x, y, radius) outside, px, the last with the number of start circles that were given before it."""

MAX_COORDINATE = 100_000
"""Pixels. No image has a longer side, and a start of this size can still be cut into patches."""
START_RADIUS_FRACTION, CLICK_RADIUS_FRACTION, MIN_START_RADIUS = 1 / 15, 0.01, 2.0
"""Radius of a start circle alone, as a fraction of the shorter side (the paper's images: 40 px of 600); of a click, as a
fraction of the longer one; and the smallest, px: a smaller circle of patches crosses itself before any sample can move."""
ZERO_BALLOON = "contour.balloon: 0 moves no free-form contour; write a number above 0 to grow, below 0 to close in"
_POSITIVE = Number(0, above=True)
_PLACE, _RADIUS = Number(-MAX_COORDINATE, MAX_COORDINATE), Number(0, MAX_COORDINATE, above=True)
_POINT = Row(("x", "y"), (_PLACE, _PLACE))
_CIRCLE = Row(("x", "y", "radius"), (_PLACE, _PLACE, _RADIUS), fewest=2)
_BOX = Row(("left", "top", "right", "bottom"), (_PLACE,) * 4)
_THRESHOLDS = Row(("low", "high"), (Number(0, 10_000),) * 2, "ascending")  # no magnitude of 8-bit grey exceeds 1443
_MAX_STARTS = 1000
_SEED = Row(("x", "y", "radius", "after"), (_PLACE, _PLACE, _RADIUS, Number(0, _MAX_STARTS)), fewest=2)


def click_radius(shape: tuple[int, ...]) -> float:
    """Radius of the disc that a click stands for in an image of shape (H, W, ...), px."""
    return max(MIN_START_RADIUS, round(CLICK_RADIUS_FRACTION * max(shape[:2]), 1))


@dataclass(frozen=True, slots=True)
class Contour(Section):
    """The free-form contour and its evolution.

    Examples
    --------
    >>> ffseg.Contour(degree=2, clearance=8).split_threshold
    40.0
    """

    degree: int = declared(3, Integer(1, 6), "degree of every patch")
    patches: int = declared(13, Integer(3, 100_000), "patches of each start contour")
    split_threshold: float = declared(40.0, Number(2, 1000), "px between control points at which a patch is split")
    balloon: float = declared(8.0, Number(-16, 16), "px per iteration along the outer normal; negative closes in")
    refine: bool = declared(True, Flag(), "split long patches and merge short ones (Section 3.3)")
    topology: bool = declared(True, Flag(), "let the contour split off, merge and enclose holes (Algorithm 3)")
    clearance: float = declared(0.0, Number(0, 1000), "px; passages narrower than this count as closed; 0 = off")
    settle: float = declared(4.0, Number(0, 16), "px within which converged points move onto the gradient ridge")
    max_iterations: int | Literal["auto"] = declared(
        "auto",
        OrWord("auto", Integer(1, 1_000_000)),
        "iterations after which the evolution ends anyway; auto = a budget of work to each pixel it may fill",
    )


@dataclass(frozen=True, slots=True)
class Edges(Section):
    """The edge map.

    Examples
    --------
    >>> import dataclasses
    >>> dataclasses.replace(ffseg.load_params().edges, source="gradient", canny=(4.0, 9.0)).sigma
    1.5
    """

    source: str = declared(
        "auto",
        Name(tuple(EDGE_SOURCES), partial(installed, "evidence")),
        "auto = gradient where its edges are clear, else prior (learned); or module:function of your own",
    )
    sigma: float = declared(1.5, Number(0, 20, above=True), "px, standard deviation of the smoothing Gaussian")
    exponent: float = declared(2.0, Number(1, 8), "p of the edge force |grad|^p (Eq. 8), which the free form lacks")
    canny: tuple[float, float] | Literal["auto"] = declared(
        "auto", OrWord("auto", _THRESHOLDS), "Canny thresholds on the gradient magnitude of 8-bit grey"
    )
    model: str | None = declared(
        None, FilePath(), "what tells inside: a file of ffseg learn (.ffmodel), or a network (.onnx)"
    )
    evidence: str = declared("inside", Text(("inside", "edges")), "what maps and networks give: inside or edges")
    levels: str = declared(
        "linear", Text(("linear", "root", "log")), "grey levels whose gradient is taken; root, log even out shade"
    )
    highlights: float = declared(
        0.0, Number(0, 200), "px; bright grey streaks (gloss, paint) narrower than this are taken out; 0 = keep them"
    )


@dataclass(frozen=True, slots=True)
class Init(Section):
    """Where the contour starts: one circle, or several circles, boxes, or the outlines in a mask image.

    Examples
    --------
    >>> ffseg.load_params(None, {"init.circles": [[400, 300, 20], [100, 90, 10]]}).init.circles
    ((400.0, 300.0, 20.0), (100.0, 90.0, 10.0))
    """

    center: Point | Literal["auto"] = declared(
        "auto", OrWord("auto", _POINT), "px; auto = image centre, or the camera's principal point"
    )
    radius: float | Literal["auto"] = declared(
        "auto", OrWord("auto", _RADIUS), "px; auto = a fifteenth of the shorter side, less where edges part that"
    )
    circles: tuple[Point | Circle, ...] = declared((), Many(_CIRCLE, _MAX_STARTS), "start circles; [x, y] is a click")
    boxes: tuple[Box, ...] = declared(
        (), Many(_BOX, _MAX_STARTS), "boxes round objects: outside all is background, unless a circle lies there"
    )
    mask: str | None = declared(None, FilePath(), "image whose outlines are the start contours")
    background: tuple[Seed, ...] = declared(
        (), Many(_SEED, _MAX_STARTS), "clicks and circles outside: the contour stops at them; after: so many circles"
    )
    background_mask: str | None = declared(None, FilePath(), "image that is nonzero at what lies outside the region")

    def radius_in(self, shape: tuple[int, ...]) -> float:
        """Radius of a start circle alone in an image of shape (H, W, ...), px."""
        return max(START_RADIUS_FRACTION * min(shape[:2]), MIN_START_RADIUS) if self.radius == "auto" else self.radius

    def click_radius_in(self, shape: tuple[int, ...]) -> float:
        """Radius of a start circle that others, boxes or clicks outside correct, px."""
        return click_radius(shape) if self.radius == "auto" else self.radius

    @property
    def named_radii(self) -> list[bool]:
        """Of each start circle, or of the one there is without any, whether somebody named its radius."""
        return [self.radius != "auto" or len(one) == 3 for one in self.circles] or [self.radius != "auto"]

    def circles_in(self, shape: tuple[int, ...]) -> tuple[Circle, ...]:
        """The circles in an image of shape (H, W, ...), each with its radius."""
        return tuple((x, y, *(radius or (self.click_radius_in(shape),))) for x, y, *radius in self.circles)


@dataclass(frozen=True, slots=True)
class Domain(Section):
    """Where the contour may go.

    Examples
    --------
    >>> ffseg.load_params(None, {"domain.disc": "off"}).domain
    Domain(mask=None, masks=None, disc='off')
    """

    mask: str | None = declared(None, FilePath(), "image that is 0 where the contour may not go")
    masks: str | None = declared(
        None, FilePath(), "folder of such images, one for each image (NAME.png) or folder of images (FOLDER.png)"
    )
    disc: str = declared(
        "auto", Text(("auto", "off")), "auto = where no mask is given, the disc of a mirror or fisheye in the dark"
    )


Levels = tuple[float, float] | Literal["auto"]
"""Of black and of white."""


@dataclass(frozen=True, slots=True)
class Input(Section):
    """How images are read.

    Examples
    --------
    >>> ffseg.load_params(None, {"input.range": [0, 4095]}).input.range
    (0.0, 4095.0)
    """

    range: Levels = declared(
        "auto",
        OrWord("auto", Row(("black", "white"), (Number(-1e9, 1e9),) * 2, "ascending and apart")),
        "values of 16-bit images; auto = what a file states, or 0 to the most of 10, 12, 14 or 16 bits that it uses",
    )


@dataclass(frozen=True, slots=True)
class Region(Section):
    """What is known of the region.

    Examples
    --------
    >>> ffseg.load_params(None, {"region.probability": 0.8}).region.border
    'free'
    """

    border: str = declared(
        "free", Text(("free", "outside")), "outside = the image's border lies outside the region, as round a thing"
    )
    weight: float = declared(
        0.0,
        Number(0, 10),
        "of colour in the balloon's pressure: 1 + weight x log odds of swept ground against the rest; 0 = edges alone",
    )
    window: float = declared(
        0.0,
        Number(0, 10_000),
        "px; colours are compared within windows so wide, 16 at least, and those beside; 0 = the whole image",
    )
    islands: bool | Literal["all"] = declared(
        True,
        OrWord("all", Flag()),
        "parts apart from the start's: those as sure by the prior; all = all that a model or map tells, else all that look alike",
    )
    probability: float = declared(
        0.5,
        Number(0.01, 0.99),
        "probability of inside at which the region ends, where the prior, a model or a map tells it; more = smaller",
    )
    largest: int = declared(0, Integer(0, 1_000_000), "so many of the largest regions are kept; 0 = all")
    min_area: int = declared(0, Integer(0, 1_000_000_000), "pixels; smaller regions are dropped")
    fill_holes: int = declared(0, Integer(0, 1_000_000_000), "pixels; smaller holes are filled")
    label: str = declared("region", Text(), "class that exports give to every region")


@dataclass(frozen=True, slots=True)
class Obstacles(Section):
    """The structural test on enclosed components (Eq. 9).

    References
    ----------
    Eq. 9 of the paper; ``altitude`` is its epsilon.

    Examples
    --------
    >>> ffseg.load_params(None, {"obstacles.altitude": 0.05}).obstacles
    Obstacles(altitude=0.05, draw=False)
    """

    altitude: float = declared(0.08, _POSITIVE, "m; a point at or above this altitude makes an obstacle")
    draw: bool = declared(
        False, Flag(), "overlays show the points of the ground, their residuals and the outlines' samples"
    )


@dataclass(frozen=True, slots=True)
class Snake(Section):
    """The parametric snake (PM), Section 5.1. It also takes contour.balloon, .refine and .max_iterations.

    References
    ----------
    Eq. 10 of the paper, with Eq. 11 where altitudes are known.

    Examples
    --------
    >>> image = ffseg.read_image("pictures/toy.png")
    >>> len(ffseg.segment(image, {"snake.spacing": 4}, method="snake").contours)
    1
    """

    tension: float = declared(0.02, Number(0, 1000), "weight of the first differences in the internal energy")
    rigidity: float = declared(0.02, Number(0, 1000), "weight of the second differences in the internal energy")
    attraction: float = declared(2.5, Number(0, 100), "px^2; edge force per slope of ln |grad I|; about sigma squared")
    spacing: float = declared(6.0, Number(1, 1000), "px between points above which one is inserted")
    tolerance: float = declared(0.05, Number(0, 10, above=True), "px per iteration; a point that moves less rests")


@dataclass(frozen=True, slots=True)
class LevelSet(Section):
    """The fast-marching level set (LS), Eq. 12. A negative contour.balloon closes in; max_iterations does not count.

    References
    ----------
    Eq. 12 of the paper.

    Examples
    --------
    >>> image = ffseg.read_image("pictures/toy.png")
    >>> ffseg.segment(image, {"levelset.min_area": 100}, method="levelset").num_holes
    4
    """

    stop_speed: float | Literal["auto"] = declared(
        "auto", OrWord("auto", Number(0, 1, above=True)), "F_diff on an edge; auto = at the high Canny threshold"
    )
    settle: int = declared(6, Integer(0, 64), "px the front climbs an edge to its ridge after it has stopped")
    min_area: float = declared(8.0, Number(0, 1e9), "px^2; outlines that enclose less are dropped")


@dataclass(frozen=True, slots=True)
class Paper(Section):
    """The method as printed (Algorithms 1 to 4). It also takes contour and edges, without clearance and settle.

    References
    ----------
    Algorithms 1 to 4 of the paper, as printed.

    Examples
    --------
    >>> image = ffseg.read_image("pictures/toy.png")
    >>> ffseg.segment(image, {"paper.balloon": 3}, method="paper").contours[0].degree
    3
    """

    balloon: float = declared(
        2.0,
        Number(0, 16, above=True),
        "px per iteration that contour.balloon is cut to: nothing else holds it at an edge",
    )


@dataclass(frozen=True, slots=True)
class Network(Section):
    """How a network of edges.model is fed and read.

    Examples
    --------
    >>> ffseg.load_params(None, {"network.activation": "softmax"}).network.size
    'auto'
    """

    size: tuple[float, float] | Literal["auto"] = declared(
        "auto", OrWord("auto", Row(("width", "height"), (Number(1, 8192),) * 2)), "px, of its input; auto = the image's"
    )
    scale: float = declared(1 / 255, Number(0, 1000, above=True), "factor on levels from 0 to 255, after the mean")
    mean: tuple[float, float, float] = declared(
        (0.0, 0.0, 0.0), Row(("red", "green", "blue"), (Number(0, 255),) * 3), "levels taken off red, green, blue"
    )
    rgb: bool = declared(True, Flag(), "its channels are red, green, blue; false = blue, green, red")
    output: str = declared("last", Text(), "name of its output; last = the last one")
    channel: int = declared(0, Integer(0, 10_000), "of its output, the map that is taken")
    activation: str = declared("none", Text(("none", "logistic", "softmax")), "what makes its output a probability")


@dataclass(frozen=True, slots=True)
class Parameters(Section):
    """Everything that decides a segmentation.

    Examples
    --------
    >>> params = ffseg.load_params()
    >>> params.method, params.contour.balloon, params.edges.canny
    ('freeform', 8.0, 'auto')
    """

    method: str = declared(
        "freeform",
        Name(tuple(METHODS), partial(installed, "methods")),
        "freeform, snake, levelset, paper, the name of a peer, or module:function of your own",
    )
    input: Input = subsection(Input)
    contour: Contour = subsection(Contour)
    edges: Edges = subsection(Edges)
    init: Init = subsection(Init)
    domain: Domain = subsection(Domain)
    region: Region = subsection(Region)
    obstacles: Obstacles = subsection(Obstacles)
    snake: Snake = subsection(Snake)
    levelset: LevelSet = subsection(LevelSet)
    paper: Paper = subsection(Paper)
    network: Network = subsection(Network)
