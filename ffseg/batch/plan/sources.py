"""One input image and its job, the suffixes of images, and the order of their names."""

from __future__ import annotations

import posixpath
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ffseg.batch.plan.reading import member_path
from ffseg.io.films import ANIMATIONS, FILMS

if TYPE_CHECKING:
    from ffseg.io.starts import Start

READ_SUFFIXES = ".png .jpg .jpeg .jpe .jfif .tif .tiff .bmp .dib .webp .gif .ppm .pgm .pbm .pnm .jp2 .avif .heic .heif"
_REFUSED = ".jxl .exr .hdr .pfm .pam .j2k .jpx .psd"
SUFFIXES = frozenset(f"{READ_SUFFIXES} {_REFUSED}".split())
"""Files of a folder that count as images, also those of formats that are refused: they get a row that says so. A file
that is named itself is taken whatever its suffix."""
STATE_FOLDER = ".ffseg"
"""Folder under the output with the lock, the journal and the error log; it marks a folder of ours."""

_DIGITS = re.compile(r"[0-9]+")


@dataclass(frozen=True, slots=True)
class InputImage:
    """One input image."""

    path: str
    """To open it."""
    name: str
    """Relative to the INPUT it was found under, with ``/`` between folders; outputs mirror it."""
    problem: str = ""
    """Why it cannot even be tried (``reason: text``), else empty."""
    place: int = 0
    """Number of the INPUT it was found under: images stand in the order of these, then of their names."""
    span: tuple[int, int] | None = None
    """Offset and length in the archive that `path` names; of a frame its number in the film, and 1."""
    time: float | None = None
    """Seconds of a frame in its film."""
    stamp: int | None = None
    """Nanoseconds of an image in its bag."""

    @property
    def content(self) -> str:
        """What `read_input` reads: the path, or that of the member in an archive."""
        return self.path if self.span is None else member_path(self.path, self.name, self.span)

    @property
    def display_path(self) -> str:
        """The path as people know it: that of a member stands behind its archive's."""
        return self.path if self.span is None else f"{self.path}/{self.name}"


@dataclass(frozen=True, slots=True)
class Job:
    """One image of a run."""

    index: int
    """Place in the input order."""
    source: InputImage
    stem: str
    """Name of its outputs below ``masks/`` and so on, without the suffix."""
    truth: str = ""
    """Path of the true mask, for `read_input`; or empty."""
    earlier: tuple[str, ...] = ()
    """Paths of the images before it in its sequence, the nearest first."""
    start: Start | None = None
    """Its own start circle; None leaves the parameters'."""
    evidence: str = ""
    """Path of its map of evidence, or empty."""
    domain: str = ""
    """Path of its own domain, or empty."""
    past: str = ""
    """Mask of the frame before it in its film, below the output folder; or empty."""

    @property
    def depends(self) -> tuple[str, ...]:
        """Paths of further files that its result depends on: with another content of one the image is done again."""
        return tuple(filter(None, (self.domain, self.evidence)))


def film_of(name: str) -> str:
    """Name of the film an image belongs to: of a frame its film's, else its folder's."""
    found = _FRAME.fullmatch(name) if _is_film(name) else None
    return (f"{found[1]}{found[2]}" if found else posixpath.dirname(name) or "images").replace("/", "_")


def _is_film(name: str) -> bool:
    return name.lower().endswith((*FILMS, *ANIMATIONS))


def film_stems(names: Iterable[str]) -> dict[str, str]:
    """The films that images of these names make, and what their outputs are called: two of one name keep their suffixes."""
    stems = {film: posixpath.splitext(film)[0] if _is_film(film) else film for film in map(film_of, names)}
    shared = Counter(stems.values())
    return {film: film if shared[stem] > 1 else stem for film, stem in stems.items()}


_FRAME = re.compile(r"(.+)_\d{6,}(\.\w+)", re.DOTALL)

_END, _PART, _NUMBER = "\x00\x00", "\x00\x01", "\x00\x02"
"""Marks after a piece of a name; they begin with what no name holds, so that a shorter piece comes first."""


def natural_key(name: str) -> str:
    """Text that puts ``a2`` before ``a10`` and keeps each folder together."""
    return _PART.join(_DIGITS.sub(_number_key, part) for part in name.split("/"))


def _number_key(digits: re.Match[str]) -> str:
    value = str(int(digits[0]))
    return f"{_NUMBER}{len(value):04d}{value}{digits[0]}{_END}"


def order_key(place: int, name: str) -> str:
    """Text that sorts images by the number of the input they were found under, then by their names in natural order."""
    return f"{place:09d}" + natural_key(name)
