"""Outputs written as files, or appended to a tar file by whole images; failed appends leave no trace."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Sequence

from ffseg.batch.outputs.table import PACKS
from ffseg.batch.tar.members import BLOCK, END, Member, final_name, padding
from ffseg.errors import OutputError
from ffseg.io.files import OWN, make_folder, printable, remove_files, write_all_atomic, write_fully

_TIME = 315_532_800
"""Time of change of every member, the first of 1980: the same outputs are the same bytes, and no program doubts it."""
_NAME_BYTES = 100
"""Of a name that has room in a header; a longer one has a member of its own before it."""
_CLOSED = -1


def head(path: str, length: int) -> bytes:
    """Header of a member, in GNU's format, which holds names of any bytes and length."""
    import tarfile  # loads what only packing needs

    member = tarfile.TarInfo(path)
    member.size, member.mtime = length, _TIME
    return member.tobuf(tarfile.GNU_FORMAT, "utf-8", "surrogateescape")


def head_size(path: str) -> int:
    """Bytes of `head`."""
    length = len(path.encode("utf-8", "surrogateescape"))
    more = 0 if length <= _NAME_BYTES else BLOCK + length + 1 + padding(length + 1)
    return BLOCK + more


def unwritable(path: str, error: OSError) -> OutputError:
    """What to say of a tar file that cannot be written."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    remedy = "free some space, then run again to go on" if full else "check the folder, then run again to go on"
    return OutputError(f"{printable(path)} cannot be written ({os.strerror(error.errno or 0)}); {remedy}")


class PackWriter:
    """Appends outputs to a tar file of its own, which is made with the first of them.

    Parameters
    ----------
    out : str
        Output folder.
    pack : str
        The tar file, below it.
    """

    def __init__(self, out: str, pack: str) -> None:
        self.pack = pack
        self._out, self._path = out, os.path.join(out, pack)
        self._descriptor = _CLOSED
        self._end = 0

    def append(self, files: Sequence[tuple[str, bytes]], *, sync: bool = True) -> dict[str, Member]:
        """Append outputs, all of them or none.

        Parameters
        ----------
        files : sequence of (path, data)
            Paths below the output folder.
        sync : bool
            Wait until they are on the disk.

        Returns
        -------
        dict
            Where each lies.
        """
        members: dict[str, Member] = {}
        data = bytearray()
        for path, content in files:
            data += head(path, len(content))
            members[path] = (self.pack, self._end + len(data), len(content))
            data += content + bytes(padding(len(content)))
        if data:
            self._write(data, sync=sync)
        return members

    def finish(self) -> None:
        """Write the end of a tar file, and wait until all is on the disk."""
        self._write(bytearray(END), sync=True)

    def _write(self, data: bytearray, *, sync: bool) -> None:
        try:
            if self._descriptor == _CLOSED:
                make_folder(os.path.dirname(self._path))
                self._descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | OWN, 0o666)
            os.lseek(self._descriptor, self._end, os.SEEK_SET)  # over what an append that failed has left
            write_fully(self._descriptor, data)
            if sync:
                os.fsync(self._descriptor)
        except OSError as error:
            if self._descriptor != _CLOSED:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._descriptor, self._end)
            raise unwritable(os.path.join(self._out, final_name(self.pack)), error) from error
        self._end += len(data)

    def close(self) -> None:
        """Close the file; one that holds nothing is removed."""
        descriptor, self._descriptor = self._descriptor, _CLOSED
        if descriptor != _CLOSED:
            os.close(descriptor)
            if not self._end:
                remove_files([self._path])


class Store:
    """Where the outputs of images go: a file each, or members of a tar file that nobody else writes to.

    Parameters
    ----------
    out : str
        Output folder.
    state : str
        State folder in which there is such a tar file.
    """

    def __init__(self, out: str, state: str, *, packed: bool) -> None:
        self._out = out
        pack = f"{os.path.relpath(os.path.join(state, PACKS), out).replace(os.sep, '/')}/{os.urandom(6).hex()}.tar"
        self._pack = PackWriter(out, pack) if packed else None

    def write(self, files: Sequence[tuple[str, bytes]]) -> dict[str, Member]:
        """Write outputs, all of them or none; where those lie that are no files of their own."""
        if self._pack is not None:
            return self._pack.append(files)
        write_all_atomic([(os.path.join(self._out, path), data) for path, data in files])
        return {}

    def close(self) -> None:
        """Close the tar file."""
        if self._pack is not None:
            self._pack.close()
