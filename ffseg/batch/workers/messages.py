"""Messages between a run and its workers: plain values without OpenCV or the core."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ffseg.batch.outputs.table import MASKS_AND_CONTOURS, Products
from ffseg.batch.tar.members import Member
from ffseg.io.files import write_fully
from ffseg.parameters import Parameters

if TYPE_CHECKING:
    from ffseg.batch.plan.sources import Job
    from ffseg.batch.values import File, Record
    from ffseg.batch.views import CameraSetup

_LENGTH_BYTES = 8
PIECE = 1 << 16
"""Bytes read at once: what a pipe holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What all jobs of a run share."""

    params: Parameters
    segmenter: str = "ffseg.pipeline:segment"
    """Function that segments, as ``module:name``, called like `ffseg.segment`; not used with `views`."""
    views: CameraSetup | None = None
    """Camera, poses and pairs, when components are to be tested on pairs of images."""
    products: Products = MASKS_AND_CONTOURS
    max_pixels: int = 100_000_000
    max_bytes: int = 1 << 30
    """Limits of one image file."""
    memory_bytes: int = 0
    """How far a worker may grow beyond its size at the start; 0 for no limit."""
    truth_label: int | None = None
    """Number that means inside in true masks; None for 255."""
    files: Mapping[str, str] = field(default_factory=dict)
    """Files that every result depends on beside the parameters, by what the user calls them, such as a key; with
    another content they count as other parameters."""
    redirects: bool = False
    """Whether HTTP may lead to another host than the one that was named."""
    past: str = ""
    """``flicker`` or ``steady`` where a frame needs the one before it, so that one worker does all in order."""


@dataclass(frozen=True, slots=True)
class Task:
    """One image for a worker."""

    job: Job
    out: str
    """Output folder."""
    outputs: tuple[str, ...]
    """Where its outputs go below `out`, one for each of the products."""
    recorded: Record | None = None
    """What an earlier run with the same parameters and version left, which makes the image unchanged if it is still
    so."""


@dataclass(frozen=True, slots=True)
class Ready:
    """A worker has loaded everything."""

    versions: dict[str, str]


@dataclass(frozen=True, slots=True)
class Refused:
    """A worker cannot work with this setup; `message` is for the user."""

    message: str


@dataclass(frozen=True, slots=True)
class Note:
    """Something the user should know that belongs to no image."""

    text: str


@dataclass(frozen=True, slots=True)
class Digests:
    """What an image's result was made from."""

    content: str
    """Digests of everything but the parameters, as one text: of the image, of the image before, of what is known of the
    pair, of the start circle and of the files it depends on."""
    truth: str = ""
    """Digest of the true mask and its label; empty without."""
    files: Mapping[str, File] = field(default_factory=dict)
    """By what each is for: ``image``, ``truth``, ``earlier 0``, ``depends 0``, ..."""


@dataclass(frozen=True, slots=True)
class Encoded:
    """One output: path below the output folder, content, digest; `data` is None when a worker has written it.

    `member` says where, if that is no file of its own.
    """

    path: str
    data: bytes | None
    digest: str
    member: Member | None = None


@dataclass(frozen=True, slots=True)
class Done:
    """An image was segmented, now or by an earlier run."""

    index: int
    row: dict[str, Any]
    """Cells of ``timings.csv`` by column, without those the run adds."""
    digests: Digests
    outputs: tuple[Encoded, ...]
    """Those that were missing."""
    kept: tuple[str, ...] = ()
    """Paths of recorded outputs that are still right."""
    extra: list[dict[str, Any]] = field(default_factory=list)
    """Lines of ``obstacles.csv``."""
    problem: str = ""
    """``reason: text`` when the image counts as failed although its outputs are right: of its true mask."""
    unchanged: bool = False
    """Nothing was made: the recorded outputs are right, and the row has what is new."""
    note: str = ""
    """What is said of it on the terminal: its note, without what came of comparing it with the images before."""


@dataclass(frozen=True, slots=True)
class Failed:
    """An image could not be done; `reason` is one of the closed list, `traceback` of a defect."""

    index: int
    reason: str
    message: str
    traceback: str = ""


Reply = Done | Failed
Event = Reply | Ready | Note


def send(descriptor: int, message: object) -> None:
    """Write one message to a pipe, whole."""
    data = pickle.dumps(message, protocol=5)
    write_fully(descriptor, len(data).to_bytes(_LENGTH_BYTES, "little") + data)


def received_messages(descriptor: int) -> Iterator[Any]:
    """Messages from a pipe, until it ends."""
    inbox = Inbox()
    while piece := os.read(descriptor, PIECE):
        yield from inbox.feed(piece)


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
