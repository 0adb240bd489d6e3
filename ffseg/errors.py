"""Errors ffseg raises on purpose: one sentence saying what and where, then the remedy."""

from __future__ import annotations


class FfsegError(Exception):
    """Base of every error ffseg raises on purpose; its text is fit to be shown to a user.

    Attributes
    ----------
    exit_code : int
        What the command line ends with.
    """

    exit_code = 2


class ParameterError(FfsegError):
    """A parameter, a parameter file or an override is wrong (exit code 2)."""


class UsageError(FfsegError):
    """The inputs or outputs of a command do not fit together (exit code 2)."""


class ImageReadError(FfsegError):
    """An image file cannot be used.

    Attributes
    ----------
    reason : str
        One of the closed list of reasons in ``ffseg.io.images``.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class SegmentationError(FfsegError):
    """An image was read but cannot be segmented as asked (a start outside the image, on an edge, ...)."""


class CalibrationError(FfsegError):
    """A camera, pose or pair file is wrong; the text names file and key."""


class OutputError(FfsegError):
    """An output cannot be written; the text names the path."""


class WorkerLostError(FfsegError):
    """Whoever works on the images is gone, and no other can take over: a scheduler, or workers that never got ready."""

    exit_code = 1


_NO_MEMORY = -4
"""Code of OpenCV's error when it gets no memory."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error says that there is no memory, of Python, NumPy, the core or OpenCV."""
    return isinstance(error, MemoryError) or getattr(error, "code", 0) == _NO_MEMORY
