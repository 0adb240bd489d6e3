"""Files whole or absent: guarded reading, atomic writing, printable names."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import re
import stat
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import BinaryIO

from ffseg.errors import ImageReadError, OutputError

TEMPORARY_PREFIX = ".ffseg-"
TEMPORARY_SUFFIX = ".tmp"
SKIP_FILE = ".ffseg-skip"
"""A folder with a file of this name is left out of walks that begin above it; named itself, it is an input."""
_counter = itertools.count()
_TOKEN = os.urandom(4).hex()

OWN = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""Flags of every file that is opened by its number, as each system has them: children do not get it, bytes stay bytes."""
AT_ONCE = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0) | OWN
"""The same where the file may be a pipe or a device, which must not be waited for."""

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}


def printable(name: str | os.PathLike[str]) -> str:
    r"""Name of a file as one line of plain text, for messages and tables.

    Bytes that are not UTF-8 become ``\xNN``, control and invisible format characters ``\uNNNN``, a backslash doubles:
    two different names never look alike.
    """
    text = os.fspath(name)
    if text.isascii() and text.isprintable() and "\\" not in text:
        return text
    return "".join(_shown(character) for character in text)


_ESCAPES = re.compile(r"\\(?:\\|x([0-9a-f]{2})|u([0-9a-f]{4})|U([0-9a-f]{8}))")


def unprintable(text: str) -> str:
    """The name that `printable` shows as `text`; the text itself where it shows none."""
    return _ESCAPES.sub(_meant, text) if "\\" in text else text


def _meant(escape: re.Match[str]) -> str:
    byte, short, long = escape.groups()
    if byte:
        return chr(0xDC00 + int(byte, 16))
    code = int(short or long or "5c", 16)
    return chr(code) if code <= 0x10FFFF and not 0xD800 <= code <= 0xDFFF else escape[0]


def _shown(character: str) -> str:
    code = ord(character)
    if character == "\\":
        return "\\\\"
    if 0xDC80 <= code <= 0xDCFF:  # surrogateescape: an undecodable byte of the name
        return f"\\x{code - 0xDC00:02x}"
    if character.isprintable():
        return character
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


def read_bytes(path: str | os.PathLike[str], max_bytes: int) -> bytes:
    """Content of a regular file, never of a pipe, device or folder.

    Parameters
    ----------
    path : path
        Links are followed.
    max_bytes : int
        Larger files are refused before a byte is read.

    Raises
    ------
    ImageReadError
        With the reason ``missing``, ``link-loop``, ``bad-name``, ``unreadable``, ``not-a-file``, ``empty`` or
        ``too-many-bytes``; the text does not name the file.
    """
    try:
        _require_regular(os.stat(path).st_mode)  # before open: opening a device can act on it
        descriptor = os.open(path, os.O_RDONLY | AT_ONCE)
        with os.fdopen(descriptor, "rb", buffering=0) as file:
            status = os.fstat(descriptor)  # again: the file may have been exchanged in between
            _require_regular(status.st_mode)
            _require_size(status.st_size, max_bytes)
            data = file.read()
    except (OSError, ValueError) as error:
        raise _refusal(error) from error
    _require_size(len(data), max_bytes)
    return data


def read_at(descriptor: int, length: int, offset: int) -> bytes:
    """Bytes of an open file from a place in it, as ``os.pread`` gives them where there is one; moves to their end."""
    os.lseek(descriptor, offset, os.SEEK_SET)
    return os.read(descriptor, length)


def _require_regular(mode: int) -> None:
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "something else")
        raise ImageReadError("not-a-file", f"it is {kind}, not a regular file; give image files")


def _require_size(size: int, max_bytes: int) -> None:
    if size == 0:
        raise ImageReadError("empty", "the file is empty; copy it again")
    if size > max_bytes:
        raise ImageReadError("too-many-bytes", f"the file has {size} bytes, the limit is {max_bytes}")


def _refusal(error: OSError | ValueError) -> ImageReadError:
    if isinstance(error, ValueError):
        return ImageReadError("bad-name", "the name holds a character no file name can hold; rename the file")
    code = error.errno
    if code in (errno.ENOENT, errno.ENOTDIR):
        return ImageReadError("missing", "there is no such file, or its link points nowhere")
    if code == errno.ELOOP:
        return ImageReadError("link-loop", "its symbolic link leads back to itself; remove the link")
    if code == errno.ENAMETOOLONG:
        return ImageReadError("bad-name", "the name is too long for the file system; rename the file")
    return ImageReadError("unreadable", f"the file cannot be read ({os.strerror(code or 0)}); check its permissions")


def write_bytes_atomic(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file whole or not at all; an earlier file of that name is kept until the new one is complete.

    It is flushed to the disk before it gets its name, so that a power cut leaves the old or the new file.

    Parameters
    ----------
    path : path
        The folder must exist.

    Raises
    ------
    OutputError
        Naming the path and the system's reason, also for a pipe, a device or a socket, which are not replaced. No
        temporary file is left.
    """
    write_all_atomic([(os.fspath(path), data)])


def write_all_atomic(files: Sequence[tuple[str, bytes]]) -> None:
    """Write files as `write_bytes_atomic` does; none gets its name before all are on the disk.

    Parameters
    ----------
    files : sequence of (path, data)
        Different paths; the folders must exist.

    Raises
    ------
    OutputError
        Naming the first path that failed. Unless a rename failed, which leaves the files before it renamed, every
        earlier file is kept.

    Notes
    -----
    All files are on their way to the disk before the first is waited for: one commit of the file system's journal then
    serves them all, as it would if a thread waited for each, for half the processor time.
    """
    temporaries = {target: temporary_path(target) for target, _ in files}
    opened: dict[str, int] = {}
    try:
        for target, data in files:
            with _naming(target):
                require_replaceable(target)
                opened[target] = os.open(temporaries[target], os.O_WRONLY | os.O_CREAT | os.O_TRUNC | OWN, 0o666)
                write_fully(opened[target], data)
                _start_writing(opened[target])
        for target, _ in files:
            with _naming(target):
                os.fsync(opened[target])
                os.close(opened.pop(target))
        for target, _ in files:
            with _naming(target):
                os.replace(temporaries[target], target)
                del temporaries[target]
    finally:
        for descriptor in opened.values():
            with contextlib.suppress(OSError):  # the error being raised names the file already
                os.close(descriptor)
        remove_files(temporaries.values())


def remove_files(paths: Iterable[str]) -> None:
    """Remove files; one that is gone already, was never made or cannot be removed is left alone."""
    for path in paths:
        with contextlib.suppress(OSError):
            os.unlink(path)


def write_fully(descriptor: int, data: bytes | bytearray) -> None:
    """Write all of it, however little the system takes at once."""
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


@contextlib.contextmanager
def _naming(target: str) -> Iterator[None]:
    """Say of which file it is that something cannot be done."""
    try:
        yield
    except OSError as error:
        raise unwritten(target, error) from error


_REMEDIES = {
    errno.ENOSPC: "free some space",
    errno.EDQUOT: "free some space",
    errno.EMFILE: "raise the limit of ulimit -n",
    errno.ENFILE: "close other programs",
    errno.EFBIG: "raise the limit of ulimit -f",
}


def unwritten(path: str, error: OSError) -> OutputError:
    """What is said of a file that cannot be written."""
    remedy = _REMEDIES.get(error.errno or 0, "check the folder")
    reason = os.strerror(error.errno) if error.errno else error
    return OutputError(f"{printable(path)} cannot be written ({reason}); {remedy}")


def require_replaceable(target: str) -> None:
    """Refuse a name that stands for a pipe, a device or a socket: a rename would put a file in its place."""
    try:
        mode = stat.S_IFMT(os.stat(target).st_mode)
    except OSError:  # nothing is there, or making the temporary says what is wrong
        return
    if mode in (stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFSOCK):
        raise OutputError(f"{printable(target)} is {_KINDS[mode]} and is not replaced; choose another name")


def _start_writing(descriptor: int) -> None:
    """Let the disk begin with what a file holds; only a hint, and not every system takes it."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)


def temporary_path(target: str) -> str:
    """A new name beside a file, under which it can be written before it gets its own.

    Short, since the file's own name may fill the 255 bytes a name can have, and different on every machine that writes
    to the same folder.
    """
    name = f"{TEMPORARY_PREFIX}{os.getpid()}-{_TOKEN}-{next(_counter)}{TEMPORARY_SUFFIX}"
    return os.path.join(os.path.dirname(target), name)


@contextlib.contextmanager
def replacement(path: str) -> Iterator[str]:
    """Name to write a file under, which gets its own when the block ends; nothing is left of it when the block fails."""
    require_replaceable(path)
    temporary = temporary_path(path)
    try:
        with _naming(path):
            yield temporary
            os.replace(temporary, path)
    finally:
        remove_files([temporary])  # unless it has got its name


_BUFFER = 1 << 20


@contextlib.contextmanager
def atomic_stream(path: str) -> Iterator[BinaryIO]:
    """Open a file of any length for writing that gets its name when the block ends; otherwise as `replacement`."""
    with replacement(path) as temporary, open(temporary, "xb", buffering=_BUFFER) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def is_temporary(name: str) -> bool:
    """Whether a file name is one of the writer's temporaries (left behind only by a killed process)."""
    return name.startswith(TEMPORARY_PREFIX) and name.endswith(TEMPORARY_SUFFIX)


def make_folder(path: str | os.PathLike[str]) -> None:
    """Create a folder and its parents."""
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        reason = os.strerror(error.errno or 0)
        raise OutputError(f"the folder {printable(path)} cannot be made ({reason}); name another folder") from error


def sync_folders(paths: Sequence[str]) -> None:
    """Flush the names in folders to the disk; file systems that cannot are left alone."""
    for path in paths:
        with contextlib.suppress(OSError):
            _sync_folder(path)


def _sync_folder(path: str) -> None:
    descriptor = os.open(path, os.O_RDONLY | OWN)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
