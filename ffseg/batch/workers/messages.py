"""What the run and its workers tell each other: plain values that need neither OpenCV nor the core to be loaded."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ffseg.batch.workers.outputs import MASKS_AND_CONTOURS, Wanted
from ffseg.parameters import Parameters

if TYPE_CHECKING:
    from ffseg.batch.views import Views
    from ffseg.formats.starts import Start

_LENGTH_BYTES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What all jobs of a run share.

    Attributes
    ----------
    params : Parameters
    segmenter : str
        Function that segments, as ``module:name``, called like `ffseg.segment`; not used with `views`.
    views : Views or None
        Camera, poses and pairs, when components are to be tested on pairs of images.
    wanted : Wanted
    max_pixels, max_bytes : int
        Limits of one image file.
    memory_bytes : int
        How far a worker may grow beyond its size at the start; 0 for no limit.
    truth_label : int or None
        Number that means inside in true masks; None for 255.
    """

    params: Parameters
    segmenter: str = "ffseg.segmenters.registry:segment"
    views: Views | None = None
    wanted: Wanted = MASKS_AND_CONTOURS
    max_pixels: int = 100_000_000
    max_bytes: int = 1 << 30
    memory_bytes: int = 0
    truth_label: int | None = None


@dataclass(frozen=True, slots=True)
class Task:
    """One image for a worker.

    Attributes
    ----------
    index : int
    path : str
    truth : str
        Path of its true mask, or empty.
    out : str
        Output folder.
    outputs : tuple of str
        Where its outputs go below `out`, one for each of the wanted kinds.
    known : tuple of (str, dict) or None
        Content digest and output digests of an earlier run with the same parameters and version.
    name : str
        Relative name of the image, by which poses are found.
    earlier : tuple of str
        Paths of the images before it, the nearest first.
    start : Start or None
        Its own start circle.
    """

    index: int
    path: str
    truth: str
    out: str
    outputs: tuple[str, ...]
    known: tuple[str, dict[str, str]] | None = None
    name: str = ""
    earlier: tuple[str, ...] = ()
    start: Start | None = None


@dataclass(frozen=True, slots=True)
class Ready:
    """A worker has loaded everything."""

    versions: dict[str, str]


@dataclass(frozen=True, slots=True)
class Refused:
    """A worker cannot work with this setup; `message` is for the user."""

    message: str


@dataclass(frozen=True, slots=True)
class Reply:
    """Outcome of one task.

    Attributes
    ----------
    index : int
    status : {"ok", "same", "failed"}
        ``same``: the earlier run's outputs are still right.
    row : dict
        Cells of ``timings.csv`` by column, without those the run adds.
    content : str
    outputs : list of (str, bytes, str)
        Path below the output folder, content, digest.
    extra : list of dict
        Lines of ``obstacles.csv``.
    reason, message, traceback : str
        Of a failure.
    """

    index: int
    status: str
    row: dict[str, Any] = field(default_factory=dict)
    content: str = ""
    outputs: tuple[tuple[str, bytes, str], ...] = ()
    extra: list[dict[str, Any]] = field(default_factory=list)
    reason: str = ""
    message: str = ""
    traceback: str = ""


def send(descriptor: int, message: object) -> None:
    """Write one message to a pipe, whole."""
    data = pickle.dumps(message, protocol=5)
    view = memoryview(len(data).to_bytes(_LENGTH_BYTES, "little") + data)
    while view:
        view = view[os.write(descriptor, view) :]


def receive(descriptor: int) -> Any:  # noqa: ANN401 - any message
    """Read one message from a pipe; None at its end."""
    head = _exactly(descriptor, _LENGTH_BYTES)
    if head is None:
        return None
    data = _exactly(descriptor, int.from_bytes(head, "little"))
    return None if data is None else pickle.loads(data)  # noqa: S301 - from our own process


def _exactly(descriptor: int, size: int) -> bytes | None:
    data = bytearray()
    while len(data) < size:
        piece = os.read(descriptor, size - len(data))
        if not piece:
            return None
        data += piece
    return bytes(data)


class Inbox:
    """Messages put together from the pieces a pipe gives, so that the reader never waits inside one."""

    def __init__(self) -> None:
        self._data = bytearray()

    def feed(self, piece: bytes) -> Iterator[Any]:
        """Take a piece and give the messages that are now whole."""
        self._data += piece
        while len(self._data) >= _LENGTH_BYTES:
            end = _LENGTH_BYTES + int.from_bytes(self._data[:_LENGTH_BYTES], "little")
            if len(self._data) < end:
                return
            message = pickle.loads(memoryview(self._data)[_LENGTH_BYTES:end])  # noqa: S301 - from our own process
            del self._data[:end]
            yield message
