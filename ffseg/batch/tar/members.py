"""The place of an output: a file of its own, or a member of a tar file below the output folder."""

from __future__ import annotations

import hashlib
import os

from ffseg.batch.outputs.table import tar_name
from ffseg.batch.plan.reading import read_input
from ffseg.errors import ImageReadError
from ffseg.io.files import read_bytes

Member = tuple[str, int, int]
"""Tar file below the output folder, and offset and length of the member's content in it."""

NOWHERE: Member = ("", 0, 0)
"""Place of an output that was found to be something else than was written: its image is done again."""
BLOCK = 512
"""Bytes that the parts of a tar file are padded to."""
END = bytes(2 * BLOCK)
"""End of a tar file."""
_MARK = "@"
_MAX_BYTES = 1 << 40
"""Of an output that is compared with what was written."""


def digest(data: bytes) -> str:
    """Digest that stands for content in the journal."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def kind_of(path: str) -> str:
    """Folder of an output: what is one tar file in the end."""
    return path.partition("/")[0]


def ordered_pack(packs: str, kind: str, token: str) -> str:
    """Tar file of a kind while it is made; once it is whole it gets the name `tar_name` in the output folder."""
    return f"{packs}/{kind}{_MARK}{token}.tar"


def is_ordered(pack: str) -> bool:
    """Whether a tar file is one of those that get a name in the output folder."""
    return _MARK in pack.rpartition("/")[2]


def final_name(pack: str) -> str:
    """Name in the output folder of a tar file that gets one there; else the name it has."""
    return tar_name(pack.rpartition("/")[2].partition(_MARK)[0]) if is_ordered(pack) else pack


def pack_path(out: str, pack: str) -> str:
    """Path of a tar file that a record names, wherever it is by now."""
    path = os.path.join(out, pack)
    return path if os.path.lexists(path) else os.path.join(out, final_name(pack))


def output_bytes(out: str, path: str, member: Member | None) -> bytes:
    """Content of an output; unlike an input it may be empty, as the labels of an empty region are."""
    place = os.path.join(out, path) if member is None else pack_path(out, member[0])
    try:
        return read_bytes(place, _MAX_BYTES) if member is None else read_input(place, _MAX_BYTES, member[1:])
    except ImageReadError as error:
        if error.reason == "empty" and os.path.isfile(place):
            return b""
        raise


def output_digest(out: str, path: str, member: Member | None = None) -> str:
    """Digest of an output; empty when it cannot be read."""
    try:
        return digest(output_bytes(out, path, member))
    except ImageReadError:
        return ""


def padding(length: int) -> int:
    """Bytes that fill up the last block of a content."""
    return -length % BLOCK
