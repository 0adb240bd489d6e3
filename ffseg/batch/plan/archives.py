"""Images inside tar files, indexed once and then read in place."""

from __future__ import annotations

import posixpath
from collections.abc import Collection, Mapping
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from ffseg.batch.outputs.table import OUTPUT_FOLDERS
from ffseg.batch.plan.sources import STATE_FOLDER, SUFFIXES, InputImage
from ffseg.errors import UsageError
from ffseg.io.files import SKIP_FILE, printable

if TYPE_CHECKING:
    import tarfile

_PACKED = (".tar.gz", ".tgz", ".tar.bz2", ".tbz", ".tar.xz", ".txz", ".tar.zst")
_MAX_MEMBERS = 100_000_000
_MAX_END = 1 << 20
"""Bytes of zeros behind the last member: two blocks of 512, filled up to a record of 10 kB, or what ``tar -b`` asks for."""

_MAX_LINKS = 40
"""Links that are followed one after another, as Linux does."""
_MAX_FOLDERS = 400
"""Folders below each other; more are no names of outputs, and more than a thousand end Python's makedirs."""


def is_archive(path: str) -> bool:
    """Whether a file is named as a tar file."""
    return path.lower().endswith((".tar", *_PACKED))


def members(path: str, suffixes: Collection[str] = SUFFIXES) -> list[InputImage]:
    """Images in a tar file, in the order they are stored in; a later one of the same name replaces the earlier.

    Parameters
    ----------
    suffixes : collection of str
        Of what counts, in lower case.

    Raises
    ------
    UsageError
        If it is compressed, so that nothing in it can be read in place, no tar file, or cut or damaged between members.
    """
    import tarfile  # loads what other inputs do not need

    if path.lower().endswith(_PACKED):
        raise UsageError(f"{printable(path)} is compressed; unpack it to a .tar first, images do not get smaller by it")
    try:
        with tarfile.open(path, "r:") as archive:
            found = _images(path, archive, suffixes)
            _require_end(archive)
    except RecursionError as error:
        raise UsageError(
            f"{printable(path)} has more headers for one member than can be read; pack it again"
        ) from error
    except (tarfile.TarError, OSError, ValueError) as error:
        raise UsageError(f"{printable(path)} cannot be read as an uncompressed tar file ({error})") from error
    return found


def _require_end(archive: tarfile.TarFile) -> None:
    """Refuse an archive that goes on where tarfile takes it to end: at a header that is damaged, cut or all zeros."""
    file: Any = archive.fileobj
    file.seek(archive.offset)
    rest = file.read(_MAX_END + 1)
    if len(rest) > _MAX_END or rest.strip(b"\0"):
        raise ValueError(
            f"it is cut or damaged at byte {archive.offset}, behind which there may be more; copy it again"
        )


def _images(path: str, archive: tarfile.TarFile, suffixes: Collection[str]) -> list[InputImage]:
    kept: Any = archive
    files: dict[str, tuple[int, int]] = {}
    links: dict[str, str] = {}
    for count, member in enumerate(archive):
        if count >= _MAX_MEMBERS:
            raise ValueError(f"more than {_MAX_MEMBERS} members")
        kept.members = []  # it would keep them all
        name = member.name.removeprefix("./")
        if member.issym() or member.islnk():
            files.pop(name, None)
            links[name] = _target(name, member)
        elif member.isreg() and not member.issparse():
            links.pop(name, None)
            files[name] = (member.offset_data, member.size)
    return [_source(path, name, files, links) for name in images_among([*files, *links], suffixes)]


def images_among(names: Collection[str], suffixes: Collection[str]) -> list[str]:
    """Of the names of all files of a tree, with ``/``, those of images that would be found in a folder of them."""
    skipped = {posixpath.dirname(name) for name in names if posixpath.basename(name) == SKIP_FILE} - {""}
    made = {name[:at] for name in names if (at := f"/{name}".find(f"/{STATE_FOLDER}/")) >= 0}
    return [name for name in names if _is_image(name, suffixes) and not _is_left_out(name, skipped, made)]


def _is_left_out(name: str, skipped: Collection[str], made: Collection[str]) -> bool:
    """Whether it would not be found in a folder: below a hidden one, one that is skipped, or one of a run's outputs."""
    for above in accumulate(name.split("/")[:-1], lambda path, folder: f"{path}/{folder}"):
        folder = posixpath.basename(above)
        outputs = folder in OUTPUT_FOLDERS and above[: -len(folder)] in made
        if outputs or (folder.startswith(".") and folder != "..") or above in skipped:
            return True
    return False


def _is_image(name: str, suffixes: Collection[str]) -> bool:
    last = name.rsplit("/", 1)[-1]
    return not last.startswith(".") and last[last.rfind(".") :].lower() in suffixes


def _target(name: str, link: tarfile.TarInfo) -> str:
    """Name of the member a link leads to: of a hard link from the root of the archive, else from the link's folder."""
    return posixpath.normpath(link.linkname if link.islnk() else f"{posixpath.dirname(name) or '.'}/{link.linkname}")


def _source(path: str, name: str, files: Mapping[str, tuple[int, int]], links: Mapping[str, str]) -> InputImage:
    """The image of a name, which may be a link to another member; one that leads elsewhere says so."""
    target = name
    for _ in range(_MAX_LINKS):
        if target in files:
            deep = name.count("/") > _MAX_FOLDERS
            problem = f"bad-name: it lies more than {_MAX_FOLDERS} folders deep; pack it again" if deep else ""
            return InputImage(path, name, problem, span=files[target])
        if target not in links:
            problem = f"missing: a link to {printable(target)}, which is no file in the archive; pack it too (tar -h)"
            return InputImage(path, name, problem, span=(0, 0))
        target = links[target]
    return InputImage(path, name, "link-loop: the link leads back to itself; pack its file instead", span=(0, 0))
