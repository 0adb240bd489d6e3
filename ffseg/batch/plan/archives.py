"""Images inside tar files, indexed once and then read in place."""

from __future__ import annotations

import tarfile
from collections.abc import Collection, Iterator
from typing import Any

from ffseg.batch.plan.discover import SUFFIXES, Source
from ffseg.errors import UsageError
from ffseg.io.files import printable

_PACKED = (".tar.gz", ".tgz", ".tar.bz2", ".tbz", ".tar.xz", ".txz", ".tar.zst")
_MOST_MEMBERS = 100_000_000
_LONGEST_END = 1 << 20
"""Bytes of zeros behind the last member: two blocks of 512, filled up to a record of 10 kB, or what ``tar -b`` asks for."""


def is_archive(path: str) -> bool:
    """Whether a file is named as a tar file."""
    return path.lower().endswith((".tar", *_PACKED))


def members(path: str, suffixes: Collection[str] = SUFFIXES) -> list[Source]:
    """Images in a tar file, in the order they are stored in; a later one of the same name replaces the earlier.

    Parameters
    ----------
    path : str
    suffixes : collection of str
        Of what counts, in lower case.

    Raises
    ------
    UsageError
        If it is compressed, so that nothing in it can be read in place, no tar file, or cut or damaged between members.
    """
    if path.lower().endswith(_PACKED):
        raise UsageError(f"{printable(path)} is compressed; unpack it to a .tar first, images do not get smaller by it")
    try:
        with tarfile.open(path, "r:") as archive:
            found = {source.name: source for source in _images(path, archive, suffixes)}
            _require_end(archive)
    except (tarfile.TarError, OSError, ValueError) as error:
        raise UsageError(f"{printable(path)} cannot be read as a tar file ({error})") from error
    return list(found.values())


def _require_end(archive: tarfile.TarFile) -> None:
    """Refuse an archive that goes on where tarfile takes it to end: at a header that is damaged, cut or all zeros."""
    file: Any = archive.fileobj
    file.seek(archive.offset)
    rest = file.read(_LONGEST_END + 1)
    if len(rest) > _LONGEST_END or rest.strip(b"\0"):
        raise ValueError(
            f"it is cut or damaged at byte {archive.offset}, behind which there may be more; copy it again"
        )


def _images(path: str, archive: tarfile.TarFile, suffixes: Collection[str]) -> Iterator[Source]:
    kept: Any = archive
    for count, member in enumerate(archive):
        if count >= _MOST_MEMBERS:
            raise ValueError(f"more than {_MOST_MEMBERS} members")
        kept.members = []  # it would keep them all
        name = member.name.removeprefix("./")
        last = name.rsplit("/", 1)[-1]
        if not member.isreg() or member.issparse() or last.startswith("."):
            continue
        if last[last.rfind(".") :].lower() in suffixes:
            yield Source(path, name, span=(member.offset_data, member.size))
