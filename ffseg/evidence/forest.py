"""Learned forests: the model file ``.ffmodel`` and its evaluation, for which nothing else is needed.

A model file is data only: the line ``ffmodel 1``, four bytes with the length of the header, the header (JSON), the
arrays of the trees as little-endian numbers, and the SHA-256 of all that stands before it.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ffseg.arrays import Image, Plane
from ffseg.errors import ImageReadError, ParameterError
from ffseg.evidence.features import ALL_FEATURES, Features, enlarged
from ffseg.evidence.maps import probability
from ffseg.evidence.surroundings import STRIDE, voted, write_strided
from ffseg.image.appearance import WORKING_SIZE, Appearance
from ffseg.image.edges import ScoreCalibration
from ffseg.io.files import printable, read_bytes
from ffseg.native import _core

MAGIC = b"ffmodel 1\n"
MAX_BYTES = 16 << 20
"""A forest of a thousand trees of 32 leaves takes 0.6 MB."""
MAX_HEADER = 1 << 16
MIN_SIZE, MAX_SIZE = 256, 4096
"""Pixels a side: the native core reduces images, of up to 65535, by 256 at most, and works on no more than the other."""
ARRAYS = (
    ("feature", "<i4", "nodes"),
    ("threshold", "<f4", "nodes"),
    ("left", "<i4", "nodes"),
    ("right", "<i4", "nodes"),
    ("root", "<i4", "trees"),
    ("value", "<f4", "leaves"),
)
"""Name, type and count of each array, in the order of the file. A child below zero is the leaf ``-1 - child``."""
MAX_PRIOR_WEIGHT = 10.0
"""Weight of the prior."""
MAX_VOTE = 14.0
"""Log odds up to which a pixel has a say among its neighbours."""
MODEL_ODDS_RATIO = 9.0
"""Odds of the overlap that a model promises over those of the IoU, where images left out have not told: as 13 models of five
drawings or photographs each ask for on others of their sets (2.4 to 73, five of them less than this)."""

UNMEASURED = ScoreCalibration(1.0, MODEL_ODDS_RATIO)
"""What the overlap that such a model promises is worth."""

REMEDY = "make it again with ffseg learn"


@dataclass(frozen=True, eq=False)
class Forest:
    """A boosted forest that classifies pixels as inside or outside.

    Attributes
    ----------
    arrays : dict of ndarray
        As ``ARRAYS`` names them; left is where a feature is at most the threshold.
    features : tuple of str
        Names of the features that ``feature`` counts, of those in ``ALL_FEATURES``.
    bias : float
        Added to the sum of the leaves; the logistic function of that is the probability of inside.
    """

    arrays: dict[str, NDArray[Any]]
    features: tuple[str, ...] = ALL_FEATURES
    bias: float = 0.0

    @cached_property
    def native(self) -> _core.EvidenceForest:
        """The forest in the native core, made once.

        Raises
        ------
        ValueError
            If the arrays are no forest: an index out of range, a loop, a number that is not finite.
        """
        arrays = {name: np.ascontiguousarray(self.arrays[name], kind[1:]) for name, kind, _ in ARRAYS}
        return _core.EvidenceForest(**arrays, features=len(self.features))

    def log_odds(self, planes: Plane) -> Plane:
        """Log odds of inside for each pixel, shape (h, w).

        Parameters
        ----------
        planes : ndarray of float32, shape (F, h, w)
            The features that the forest asks for, in the order of ``features``.
        """
        score = np.empty(planes.shape[1:], np.float32)
        self.native.score(planes, score)
        found: Plane = score + np.float32(self.bias)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Content of a model file.

    Attributes
    ----------
    inside : Forest
        Tells what lies inside, seen from the start.
    start : Forest or None
        Tells the same without a start, so that one can be found.
    size : int
        Pixels a side that features are computed at.
    about : dict
        What it was learned from and how well it did, for people.
    exposed : bool
        Whether it was shown images without haze and in even exposure (see `normalised_exposure`), as the prior is.
    prior : float
        Weight of the prior's log odds, which are added to its own; 0 = the prior is not asked.
    """

    inside: Forest
    start: Forest | None = None
    size: int = WORKING_SIZE
    about: dict[str, Any] = field(default_factory=dict)
    exposed: bool = False
    prior: float = 0.0

    @property
    def calibration(self) -> ScoreCalibration:
        """What the overlap that it promises is worth, as measured on images left out, if it was."""
        ratio = self.about.get("odds_ratio")
        if isinstance(ratio, float) and 0 < ratio < math.inf:
            return ScoreCalibration(1.0, ratio)
        return UNMEASURED

    @property
    def parts(self) -> bool:
        """Whether all parts that it tells are meant, as in the masks that it was learned from, and not the start's alone."""
        return self.about.get("parts") is True

    def appearance(self, image: Image) -> Appearance:
        """The image as the model expects it, with or without the correction of exposure."""
        return Appearance(image, self.size, self.exposed)

    def map(self, seen: Features, prior: Plane | None = None) -> Plane:
        """Probability of inside for each pixel of the image, shape (H, W).

        Parameters
        ----------
        prior : ndarray of float32, shape (H, W)
            The prior's log odds, needed where the model asks it.

        Notes
        -----
        Every `STRIDE`-th pixel each way is asked, and neighbours vote within edges, as they do for the prior: a few
        masks leave specks and seams, and on floors and roads the contour comes out better by up to .01, in a third of
        the time.
        """
        planes = np.empty((len(self.inside.features), *seen.inside[::STRIDE, ::STRIDE].shape), np.float32)
        write_strided(seen, self.inside.features, planes)
        smooth = voted(np.clip(self.inside.log_odds(planes), -MAX_VOTE, MAX_VOTE), seen)
        if not self.prior:
            return enlarged(probability(smooth), seen.factor, seen.shape, STRIDE)
        if prior is None:
            raise ValueError("this model asks the prior; give its log odds")
        return probability(enlarged(smooth, seen.factor, seen.shape, STRIDE) + np.float32(self.prior) * prior)


def to_bytes(model: Model) -> bytes:
    """The model file."""
    forests = {"inside": model.inside, "start": model.start}
    header = {
        "size": model.size,
        "about": model.about,
        **({"exposed": True} if model.exposed else {}),
        **({"prior": model.prior} if model.prior else {}),
        "forests": {name: _described(forest) for name, forest in forests.items() if forest is not None},
    }
    text = json.dumps(header, allow_nan=False).encode()
    if len(text) > MAX_HEADER:
        raise ParameterError(f"what is said about the model takes {len(text)} bytes, more than {MAX_HEADER}; say less")
    whole = [forest for forest in forests.values() if forest is not None]
    body = b"".join(np.asarray(one.arrays[name], kind).tobytes() for one in whole for name, kind, _ in ARRAYS)
    data = MAGIC + struct.pack("<I", len(text)) + text + body
    return data + hashlib.sha256(data).digest()


def _described(forest: Forest) -> dict[str, Any]:
    counts = {count: len(forest.arrays[name]) for name, _, count in ARRAYS}
    return {"features": forest.features, "bias": forest.bias, **counts}


def load_model(path: str | os.PathLike[str], known: tuple[str, ...] = ALL_FEATURES) -> Model:
    """Read a model file; `known` are the features that its forests may ask for.

    Raises
    ------
    ParameterError
        If it cannot be read, or is not what ``to_bytes`` writes; the text names the file.
    """
    name = printable(path)
    try:
        data = read_bytes(path, MAX_BYTES)
    except ImageReadError as error:
        raise ParameterError(f"model {name}: {error}; name a file that ffseg learn has written") from error
    try:
        return from_bytes(data, known)
    except ValueError as error:
        raise ParameterError(f"model {name}: {error}; {REMEDY}") from error


FREED_BYTES = 16 << 20
"""Of one block. The C library (glibc) keeps freed memory up to twice the largest block that it has mapped and freed; it may never
have been one, and then gives the planes of every image back and asks for them anew, a tenth of the time at 640x480."""


@lru_cache(maxsize=4)
def shipped(path: Path, known: tuple[str, ...]) -> Model:
    """A model that is part of the package, read once."""
    with suppress(MemoryError):  # there may be room for a small image only
        np.empty(FREED_BYTES, np.uint8)  # and freed; none of its pages is touched
    return load_model(path, known)


def from_bytes(data: bytes, known: tuple[str, ...] = ALL_FEATURES) -> Model:
    """The model in a file.

    Raises
    ------
    ValueError
        If it is not what ``to_bytes`` writes.
    """
    head = len(MAGIC) + 4
    if not data.startswith(MAGIC):
        raise ValueError("it is not a model file of this version, whose first line is 'ffmodel 1'")
    if len(data) < head + hashlib.sha256().digest_size or hashlib.sha256(data[:-32]).digest() != data[-32:]:
        raise ValueError("its digest does not fit: it is cut or altered")
    length = struct.unpack("<I", data[len(MAGIC) : head])[0]
    if length > min(MAX_HEADER, len(data) - head - 32):
        raise ValueError("its header is longer than it may be")
    header = _header(data[head : head + length], known)
    body = data[head + length : -32]
    described = header["forests"]
    sizes = [one[count] * np.dtype(kind).itemsize for one in described.values() for _, kind, count in ARRAYS]
    if sum(sizes) != len(body):
        raise ValueError("its arrays are longer or shorter than its header says")
    pieces = [body[a:b] for a, b in pairwise(np.cumsum([0, *sizes]).tolist())]
    forests = {}
    for place, (name, one) in enumerate(described.items()):
        own = pieces[place * len(ARRAYS) : (place + 1) * len(ARRAYS)]
        arrays = {key: np.frombuffer(piece, kind) for (key, kind, _), piece in zip(ARRAYS, own, strict=True)}
        forests[name] = Forest(arrays, tuple(one["features"]), float(one["bias"]))
        _ = forests[name].native  # refuses what is no forest
    said = header["size"], header["about"], header["exposed"], float(header["prior"])
    return Model(forests["inside"], forests.get("start"), *said)


def _header(text: bytes, known: tuple[str, ...]) -> dict[str, Any]:
    """The header, with values of the types and ranges that they may have."""
    try:
        header: dict[str, Any] = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError("its header is not JSON") from error
    if isinstance(header, dict):
        header.setdefault("exposed", False)  # as the prior's has none
        header.setdefault("prior", 0.0)
    _require_keys(header, {"size", "about", "forests", "exposed", "prior"}, "its header")
    if type(header["prior"]) not in (int, float) or not 0 <= header["prior"] <= MAX_PRIOR_WEIGHT:
        raise ValueError(f"prior in its header is not a number from 0 to {MAX_PRIOR_WEIGHT:g}")
    if not isinstance(header["exposed"], bool):
        raise ValueError("exposed in its header is neither true nor false")
    _require_whole(header, "size", MIN_SIZE, MAX_SIZE)
    if not isinstance(header["about"], dict):
        raise ValueError("about in its header is not a table")
    forests = header["forests"]
    if not isinstance(forests, dict) or not {"inside"} <= set(forests) <= {"inside", "start"}:
        raise ValueError("forests in its header does not name 'inside', or names more than 'inside' and 'start'")
    for one in forests.values():
        _check_forest(one, known)
    return header


def _check_forest(one: Any, known: tuple[str, ...]) -> None:  # noqa: ANN401 - what JSON held
    counts = ("nodes", "trees", "leaves")
    _require_keys(one, {"features", "bias", *counts}, "a forest in its header")
    for count in counts:
        _require_whole(one, count, 0 if count == "nodes" else 1, MAX_BYTES)
    bias = one["bias"]
    if type(bias) not in (int, float) or not math.isfinite(bias) or abs(bias) > 1e6:
        raise ValueError("bias in its header is not a finite number up to 1e6")
    names = one["features"]
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise ValueError("features in its header is not a list of names")
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"it asks for a feature that this version does not have, {unknown[0][:40]!r}")


def _require_keys(table: Any, keys: set[str], what: str) -> None:  # noqa: ANN401 - what JSON held
    if not isinstance(table, dict) or set(table) != keys:
        raise ValueError(f"{what} does not have the keys {', '.join(sorted(keys))}")


def _require_whole(table: dict[str, Any], key: str, least: int, most: int) -> None:
    if type(table[key]) is not int or not least <= table[key] <= most:
        raise ValueError(f"{key} in its header is not a whole number from {least} to {most}")
