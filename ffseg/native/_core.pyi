"""Native loops of ffseg: arrays in, arrays out; no files, no policy."""

from collections.abc import Sequence
from typing import Annotated

import numpy
from numpy.typing import NDArray


def liveliest_lines(plane: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), device='cpu', writable=False)], most: int, step: int, skip: int) -> NDArray[numpy.float32]:
    """
    Of every `step`-th line the `most` that change most between every `skip`-th pixels, one after the other.
    """

def lines_amiss(lines: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], rest: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], factor: int, rounded: float, most: float) -> list[float]:
    """
    The share of pixels in lines that each kind of interpolation cannot make, exact only where one is at most `most`.
    """

def gradient_and_ridges(image: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu', writable=False)], sigma: float, gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu')], ridges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Gradient magnitude of the strongest channel of the smoothed image, in 1/32 grey level per pixel, and 1 on its ridges (0 elsewhere).
    """

def canny_auto(gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, factor: float, least: float, low_ratio: float, spread: float, edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> int:
    """
    Canny edges (255) from the ridges in `edges`, in place, with thresholds from the local noise; returns the noise of quiet windows. Stored units.
    """

def canny(gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], low: int, high: int, edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Canny edges (255) from the ridges in `edges`, in place, by hysteresis; thresholds in stored units.
    """

def gradients_at(joints: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, margin: int) -> NDArray[numpy.uint16]:
    """
    The largest of nine gradients at each joint not within `margin` px of the border of image or domain.
    """

def lively_share(region: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], levels: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], step: int, most: float) -> float:
    """
    Part of a region, on every `step`-th row, with gradients above the level for the squared distance to the nearest pixel outside; the last holds farther inside, and nothing at distance 1. 1 if more than `most`.
    """

def share_within(joints: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], ends: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], shape: tuple[int, int], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, margin: int) -> float:
    """
    Part of the polygons' length within `margin` px of the border of the image or the domain.
    """

def evidence_lab(image: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu', writable=False)], factor: int, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """L, a, b of the means of blocks of `factor` x `factor` pixels."""

def evidence_thin(planes: Sequence[Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)]], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """Every second pixel each way of these planes."""

def evidence_steepest(plane: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """The largest value of each 2 x 2 pixels."""

def evidence_enlarge(plane: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], factor: int, stride: int, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    A plane whose values are `stride` blocks of `factor` pixels apart at each pixel, linear between them.
    """

def evidence_logarithm(values: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """Natural logarithms of positive values, the same on every processor."""

def evidence_exponential(values: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Exponentials of values, no more than 87 either way, the same on every processor.
    """

def evidence_blur(plane: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], sigma: float, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """Gaussian smoothing; outside, the border repeats."""

def evidence_texture(lab: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], sigma: float, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """
    L, a, b smoothed; gradient of L, of a and b, of all; eigenvalues of the structure tensor of L.
    """

def evidence_colour(lab: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], sigma: float, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """L, a, b smoothed; gradient of all."""

def evidence_relative(lab: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], inside: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], floor: float, some: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """
    L, a, b of some pixels less their means inside, and their length over deviation inside + floor.
    """

def evidence_likelihood(lab: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], inside: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Logarithm of how much likelier a pixel's colour is inside than in the whole plane.
    """

def evidence_diffuse(values: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], lab: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], kept: float, contrast: float, steps: int, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Smoothing that stops at edges: Jacobi's method for Grady's random walker with priors.
    """

def evidence_barrier(heights: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], inside: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], step: float, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """
    Least maximum of the heights on a way from inside; its logarithm over the median inside; shares of pixels at or below it, at it, and about at it.
    """

def evidence_geodesic(heights: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], inside: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], step: float, least: int, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Length of the cheapest way from inside, where a pixel costs its height + least, in steps.
    """

def evidence_level(above: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu', writable=False)], undecided: float, snap: float, width: float, height: float, gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu')], edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Edges where a map crosses zero, in place: a ridge in the gradient, and the image's own where it is undecided.
    """

class EvidenceForest:
    """A boosted forest of trees with at most 32 leaves each."""

    def __init__(self, feature: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], threshold: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], left: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], right: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], root: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], value: Annotated[NDArray[numpy.float32], dict(shape=(None,), order='C', device='cpu', writable=False)], features: int) -> None: ...

    @property
    def features(self) -> int: ...

    @property
    def trees(self) -> int: ...

    def score(self, planes: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.float32], dict(shape=(None, None), order='C', device='cpu')]) -> None:
        """Sum of the leaves that each pixel reaches."""

class EvolutionOptions:
    def __init__(self) -> None: ...

    @property
    def degree(self) -> int: ...

    @degree.setter
    def degree(self, arg: int, /) -> None: ...

    @property
    def split_threshold(self) -> float: ...

    @split_threshold.setter
    def split_threshold(self, arg: float, /) -> None: ...

    @property
    def balloon(self) -> float: ...

    @balloon.setter
    def balloon(self, arg: float, /) -> None: ...

    @property
    def refine(self) -> bool: ...

    @refine.setter
    def refine(self, arg: bool, /) -> None: ...

    @property
    def topology(self) -> bool: ...

    @topology.setter
    def topology(self, arg: bool, /) -> None: ...

    @property
    def max_iterations(self) -> int: ...

    @max_iterations.setter
    def max_iterations(self, arg: int, /) -> None: ...

    @property
    def budget(self) -> int: ...

    @budget.setter
    def budget(self, arg: int, /) -> None: ...

    @property
    def clearance(self) -> float: ...

    @clearance.setter
    def clearance(self, arg: float, /) -> None: ...

    @property
    def settle(self) -> float: ...

    @settle.setter
    def settle(self, arg: float, /) -> None: ...

    @property
    def ridge_low(self) -> float: ...

    @ridge_low.setter
    def ridge_low(self, arg: float, /) -> None: ...

    @property
    def weight(self) -> float: ...

    @weight.setter
    def weight(self, arg: float, /) -> None: ...

    @property
    def window(self) -> float: ...

    @window.setter
    def window(self, arg: float, /) -> None: ...

class Evolution:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, options: EvolutionOptions, image: Annotated[NDArray[numpy.uint8], dict(shape=(None, None, None), order='C', device='cpu', writable=False)] | None = None, plane: Annotated[NDArray[numpy.int32], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None = None) -> None: ...

    def advance(self, iterations: int) -> bool:
        """Runs iterations; False once the contour has stopped."""

    def settle(self, gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None:
        """Attracts the contour to the ridge of the gradient."""

    def contours(self) -> tuple:
        """Control points (M, 2) of all contours and their offsets."""

    def counts(self) -> dict: ...

    @property
    def stop_reason(self) -> str: ...

def rasterize(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], degrees: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], tolerance: float, out: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Region (winding > 0) of closed contours at the pixel centres, 1 or 0 into `out`.
    """

def crossings(steps: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], degrees: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], tolerance: float) -> NDArray[numpy.float64]:
    """
    Steps between pixel centres, by their middles, moved to where closed contours cross them.
    """

def signed_areas(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], matrix: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> list[float]:
    """
    Signed area of each contour; the matrix takes the coordinates of a patch to its part.
    """

def steps_along_axes(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> list[float]:
    """Length of each control polygon along the axes."""

class Pressure:
    """The balloon's pressure by colour."""

    def __init__(self, image: Annotated[NDArray[numpy.uint8], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], weight: float, window: float) -> None: ...

    def fit(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], degree: int, closes_in: bool) -> None: ...

    def at(self, x: float, y: float) -> float:
        """The share of the full pressure there."""

def path_text(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], degree: int) -> str:
    """
    SVG path of one closed contour: M, L or Q or C, Z, four digits behind the point at most.
    """

def fast_march(speed: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], stop_speed: float, inside: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None) -> tuple:
    """
    Arrival times (H * W), accepted nodes in order, on-contour nodes, size of the first narrow band.
    """

def mask_outlines(mask: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple:
    """
    Outlines (flat x, y) half-way between pixels inside and outside, and their offsets; holes turn the other way.
    """

class LevelSetOptions:
    def __init__(self) -> None: ...

    @property
    def stop(self) -> int: ...

    @stop.setter
    def stop(self, arg: int, /) -> None: ...

    @property
    def reach(self) -> int: ...

    @reach.setter
    def reach(self, arg: int, /) -> None: ...

    @property
    def closing_in(self) -> bool: ...

    @closing_in.setter
    def closing_in(self, arg: bool, /) -> None: ...

    @property
    def min_area(self) -> float: ...

    @min_area.setter
    def min_area(self, arg: float, /) -> None: ...

def level_set(gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], slowness: Annotated[NDArray[numpy.float64], dict(shape=(65536), order='C', device='cpu', writable=False)], inside: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, options: LevelSetOptions) -> tuple:
    """Outlines (flat x, y), their offsets and the counts of a level set."""

def nearest_distances(points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], others: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]:
    """
    Distance of each point to the nearest of the others; infinite without others.
    """

def lzw_size(data: bytes) -> int:
    """
    Bytes that TIFF's LZW codes stand for; -1 when a code has no meaning where it stands.
    """

def packbits_size(data: bytes) -> int:
    """Bytes that PackBits runs stand for; -1 when a run goes beyond the end."""

def harris_points(image: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], windows: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], masks: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)], grow: int, points: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu')], counts: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu')]) -> None:
    """
    Harris corners of components grown by `grow` pixels, strongest first, into `points`.
    """

def outline_points(image: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], windows: Annotated[NDArray[numpy.int64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], masks: Annotated[NDArray[numpy.uint8], dict(shape=(None,), order='C', device='cpu', writable=False)], grow: int, points: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu')], counts: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu')]) -> None:
    """
    Samples of the strongest edges of components grown by `grow` pixels, into `points`.
    """

def patch_scores(current: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], previous: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], centers: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], candidates: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], warps: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], radius: int, hopeless: float, out: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Normalised cross-correlation of patches against warped candidates of the previous image, into `out`.
    """

def align_patches(current: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], previous: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], centers: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], starts: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], warps: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], radius: int, steps: int, out: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """Sub-pixel alignment of patches in the previous image, into `out`."""

class PaperOptions:
    def __init__(self) -> None: ...

    @property
    def degree(self) -> int: ...

    @degree.setter
    def degree(self, arg: int, /) -> None: ...

    @property
    def split_threshold(self) -> float: ...

    @split_threshold.setter
    def split_threshold(self, arg: float, /) -> None: ...

    @property
    def balloon(self) -> float: ...

    @balloon.setter
    def balloon(self, arg: float, /) -> None: ...

    @property
    def exponent(self) -> float: ...

    @exponent.setter
    def exponent(self, arg: float, /) -> None: ...

    @property
    def sigma(self) -> float: ...

    @sigma.setter
    def sigma(self, arg: float, /) -> None: ...

    @property
    def refine(self) -> bool: ...

    @refine.setter
    def refine(self, arg: bool, /) -> None: ...

    @property
    def topology(self) -> bool: ...

    @topology.setter
    def topology(self, arg: bool, /) -> None: ...

    @property
    def max_iterations(self) -> int: ...

    @max_iterations.setter
    def max_iterations(self, arg: int, /) -> None: ...

    @property
    def budget(self) -> int: ...

    @budget.setter
    def budget(self, arg: int, /) -> None: ...

class PaperEvolution:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, options: PaperOptions) -> None: ...

    def advance(self, iterations: int) -> bool:
        """Runs iterations; False once the contour has stopped."""

    def step(self) -> tuple[int, int]:
        """One iteration of Algorithm 4: how many samples moved, of how many."""

    def split(self) -> None: ...

    def prune(self) -> None: ...

    def flip(self) -> None: ...

    def meeting(self) -> list[list[int]]:
        """
        Component and patch of both patches of each pair that passes the filter.
        """

    def contours(self) -> tuple:
        """
        Control points (M, 2) of all contours and their offsets; those set aside come last.
        """

    def counts(self) -> dict: ...

    @property
    def stop_reason(self) -> str: ...

class SnakeOptions:
    def __init__(self) -> None: ...

    @property
    def tension(self) -> float: ...

    @tension.setter
    def tension(self, arg: float, /) -> None: ...

    @property
    def rigidity(self) -> float: ...

    @rigidity.setter
    def rigidity(self, arg: float, /) -> None: ...

    @property
    def balloon(self) -> float: ...

    @balloon.setter
    def balloon(self, arg: float, /) -> None: ...

    @property
    def attraction(self) -> float: ...

    @attraction.setter
    def attraction(self, arg: float, /) -> None: ...

    @property
    def spacing(self) -> float: ...

    @spacing.setter
    def spacing(self, arg: float, /) -> None: ...

    @property
    def tolerance(self) -> float: ...

    @tolerance.setter
    def tolerance(self, arg: float, /) -> None: ...

    @property
    def refine(self) -> bool: ...

    @refine.setter
    def refine(self, arg: bool, /) -> None: ...

    @property
    def budget(self) -> int: ...

    @budget.setter
    def budget(self, arg: int, /) -> None: ...

    @property
    def max_iterations(self) -> int: ...

    @max_iterations.setter
    def max_iterations(self, arg: int, /) -> None: ...

class Snake:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu', writable=False)], edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, altitudes: Annotated[NDArray[numpy.float64], dict(shape=(None, 4), order='C', device='cpu', writable=False)], epsilon: float, options: SnakeOptions) -> None: ...

    def advance(self, iterations: int) -> bool:
        """Runs iterations; False once the snake has stopped."""

    def points(self) -> NDArray[numpy.float64]:
        """Points of the snake, (M, 2)."""

    @property
    def iterations(self) -> int: ...

    @property
    def insertions(self) -> int: ...

    @property
    def removals(self) -> int: ...

    @property
    def stop_reason(self) -> str: ...
