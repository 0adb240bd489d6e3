"""Native loops of ffseg: arrays in, arrays out; no files, no policy."""

from typing import Annotated

import numpy
from numpy.typing import NDArray


def gradient_magnitude(smoothed: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu', writable=False)], out: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Sobel gradient magnitude of the strongest channel, in 1/32 grey level per pixel, into `out`.
    """

def canny_auto(smoothed: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu', writable=False)], gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu')], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, factor: float, least: float, low_ratio: float, spread: float, out: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> int:
    """
    Canny edges with thresholds from the local noise; returns the median gradient. Stored units.
    """

def canny(smoothed: Annotated[NDArray[numpy.uint8], dict(order='C', device='cpu', writable=False)], gradient: Annotated[NDArray[numpy.uint16], dict(shape=(None, None), order='C', device='cpu')], low: int, high: int, out: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu')]) -> None:
    """
    Canny edges (255) by non-maximum suppression and hysteresis; thresholds in stored units.
    """

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

class Evolution:
    def __init__(self, points: Annotated[NDArray[numpy.float64], dict(shape=(None, 2), order='C', device='cpu', writable=False)], offsets: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], edges: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)], domain: Annotated[NDArray[numpy.uint8], dict(shape=(None, None), order='C', device='cpu', writable=False)] | None, options: EvolutionOptions) -> None: ...

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
