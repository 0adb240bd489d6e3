"""Files whole or absent: guarded reading, atomic writing, names made fit to be shown."""

from __future__ import annotations

import contextlib
import errno
import itertools
import os
import stat

from ffseg.errors import ImageReadError, OutputError

TEMPORARY_PREFIX = ".ffseg-"
TEMPORARY_SUFFIX = ".tmp"
_counter = itertools.count()

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
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
        with os.fdopen(descriptor, "rb", buffering=0) as file:
            status = os.fstat(descriptor)  # again: the file may have been exchanged in between
            _require_regular(status.st_mode)
            _require_size(status.st_size, max_bytes)
            data = file.read()
    except (OSError, ValueError) as error:
        raise _refusal(error) from error
    _require_size(len(data), max_bytes)
    return data


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


def write_bytes_atomic(path: str | os.PathLike[str], data: bytes, *, durable: bool = True) -> None:
    """Write a file whole or not at all; an earlier file of that name is kept until the new one is complete.

    Parameters
    ----------
    path : path
        The folder must exist.
    data : bytes
    durable : bool
        Flush to the disk before the file gets its name, so that a power cut leaves the old or the new file.

    Raises
    ------
    OutputError
        Naming the path and the system's reason. No temporary file is left.
    """
    target = os.fspath(path)
    temporary = os.path.join(os.path.dirname(target), _temporary_name())
    try:
        _write_new(temporary, data, durable=durable)
        os.replace(temporary, target)
    except OSError as error:
        _discard(temporary)
        remedy = "free some space" if error.errno in (errno.ENOSPC, errno.EDQUOT) else "check the folder"
        raise OutputError(
            f"{printable(target)} cannot be written ({os.strerror(error.errno or 0)}); {remedy}"
        ) from error
    except BaseException:
        _discard(temporary)
        raise


def _temporary_name() -> str:
    # Short and of our own making: the target's name may already fill the 255 bytes a name can have.
    return f"{TEMPORARY_PREFIX}{os.getpid()}-{next(_counter)}{TEMPORARY_SUFFIX}"


def _write_new(path: str, data: bytes, *, durable: bool) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o666)
    try:
        view = memoryview(data)
        while view:
            view = view[os.write(descriptor, view) :]
        if durable:
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _discard(path: str) -> None:
    with contextlib.suppress(OSError):  # never created, or the disk is gone: the error being raised names it already
        os.unlink(path)


def is_temporary(name: str) -> bool:
    """Whether a file name is one of the writer's temporaries (left behind only by a killed process)."""
    return name.startswith(TEMPORARY_PREFIX) and name.endswith(TEMPORARY_SUFFIX)


def make_folder(path: str | os.PathLike[str]) -> None:
    """Create a folder and its parents.

    Raises
    ------
    OutputError
        Naming the folder.
    """
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        raise OutputError(f"the folder {printable(path)} cannot be made ({os.strerror(error.errno or 0)})") from error


def sync_folder(path: str | os.PathLike[str]) -> None:
    """Flush the names in a folder to the disk; file systems that cannot are left alone."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError:
        pass
    finally:
        os.close(descriptor)
