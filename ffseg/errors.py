"""Errors ffseg raises on purpose: one sentence saying what and where, then the remedy."""

from __future__ import annotations

from typing import Self


class FfsegError(Exception):
    """Base of every error ffseg raises on purpose; its text is fit to be shown to a user.

    Attributes
    ----------
    exit_code : int
        What the command line ends with.
    reason : str
        What stands before the colon in the cell ``error`` of an image that it costs.

    Examples
    --------
    >>> try:
    ...     ffseg.segment(ffseg.read_image("pictures/none.png"))
    ... except ffseg.FfsegError as error:
    ...     print(type(error).__name__, error.exit_code)
    ImageReadError 2
    """

    exit_code = 2
    reason = "parameters"


class ParameterError(FfsegError):
    """A parameter, a parameter file or an override is wrong (exit code 2).

    Examples
    --------
    >>> ffseg.load_params(None, {"contour.degre": 2})
    Traceback (most recent call last):
    ffseg.errors.ParameterError: overrides: contour.degre: unknown key; did you mean 'contour.degree'?
    """


class UsageError(FfsegError):
    """The inputs or outputs of a command do not fit together (exit code 2).

    Examples
    --------
    >>> issubclass(ffseg.UsageError, ffseg.FfsegError), ffseg.UsageError.exit_code
    (True, 2)
    """


class ImageReadError(FfsegError):
    """An image file cannot be used.

    Attributes
    ----------
    reason : str
        One of the closed list of reasons in ``ffseg.io.images``.

    Examples
    --------
    >>> try:
    ...     ffseg.read_image("pictures/pair/poses.csv")
    ... except ffseg.ImageReadError as error:
    ...     print(error.reason)
    not-an-image
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason

    def __reduce__(self) -> tuple[type[Self], tuple[str, str]]:
        return type(self), (self.reason, str(self))  # pools of processes send errors so


class SegmentationError(FfsegError):
    """An image was read but cannot be segmented as asked (a start outside the image, on an edge, ...).

    Examples
    --------
    >>> ffseg.segment(ffseg.read_image("pictures/toy.png"), {"init.center": [-100, 5]})  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ffseg.errors.SegmentationError: the start circle at (-100, 5), radius 40 has its centre outside the image ...
    """

    reason = "segmentation"


class CalibrationError(FfsegError):
    """A camera, pose or pair file is wrong; the text names file and key.

    Examples
    --------
    >>> ffseg.load_camera("pictures/none.yaml")
    Traceback (most recent call last):
    ffseg.errors.CalibrationError: pictures/none.yaml: cannot be read (No such file or directory); check the path
    """

    reason = "calibration"


class OutputError(FfsegError):
    """An output cannot be written; the text names the path.

    Examples
    --------
    >>> result = ffseg.segment(ffseg.read_image("pictures/toy.png"))
    >>> result.save_mask("no/such/folder.png")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ffseg.errors.OutputError: no/such/folder.png ...
    """


class WorkerLostError(FfsegError):
    """Whoever works on the images is gone, and no other can take over: a scheduler, or workers that never got ready."""

    exit_code = 1


_MAX_SAID = 160


def said(error: BaseException) -> str:
    """What a parser of somebody else says of what it cannot read, on one line, at most 160 characters."""
    return " ".join((str(error) or type(error).__name__).split())[:_MAX_SAID]


_NO_MEMORY = -4
"""Code of OpenCV's error when it gets no memory."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error says that there is no memory, of Python, NumPy, the core or OpenCV."""
    return isinstance(error, MemoryError) or getattr(error, "code", 0) == _NO_MEMORY
