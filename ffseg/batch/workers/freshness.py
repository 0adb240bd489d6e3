"""What a result depends on, and whether an earlier one is still valid; imports neither NumPy nor OpenCV."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ffseg.batch.plan.reading import display_path, place_of, read_input, split_member_path
from ffseg.batch.tar.members import Member, digest, output_digest
from ffseg.batch.tar.writer import head, head_size
from ffseg.batch.values import File, Mark, Record
from ffseg.batch.workers.messages import Digests, Setup
from ffseg.errors import ImageReadError
from ffseg.io.files import printable

if TYPE_CHECKING:
    from ffseg.batch.plan.sources import Job

_MAX_BYTES = 1 << 40
"""Of a member that is compared with what it was."""


def mark_of(path: str) -> Mark:
    """Size and time of change of a file, for a member of its archive; (-1, -1) when it is not there."""
    try:
        status = os.stat(split_member_path(path)[0])
    except (OSError, ValueError):
        return (-1, -1)
    return status.st_size, status.st_mtime_ns


@dataclass(frozen=True, slots=True)
class JobFiles:
    """The files of a job, read once."""

    data: bytes
    """The image."""
    before: list[bytes]
    """The images before, the nearest first; empty, which no decoder takes, when one cannot be read."""
    digests: Digests
    truth_problem: str = ""
    """Why the true mask cannot be used."""


def read_job(job: Job, setup: Setup) -> JobFiles:
    """Read the files of a job and digest them."""
    # Frames of a film are read in rising order.
    earlier = [_optional(path, setup.max_bytes) for path in reversed(job.earlier)][::-1]
    source = job.source
    mark = mark_of(source.path)  # before the content: a change in between makes the mark stale, not the digest
    data = read_input(source.path, setup.max_bytes, source.span, redirects=setup.redirects)
    files: dict[str, File] = {"image": (place_of(source.content), digest(data), mark)}
    content = [files["image"][1]]
    before = [found for found, _ in earlier]
    files |= {f"earlier {number}": file for number, (_, file) in enumerate(earlier)}
    if setup.views is not None:
        seen = digest("".join(map(digest, before)).encode("ascii"))
        content.append(seen + digest(setup.views.pair_text(source.name).encode("utf-8")))
    if job.start is not None:
        content.append(f"start {digest(job.start.text().encode('ascii'))}")
    for number, path in enumerate(job.depends):
        _, files[f"depends {number}"] = _optional(path, setup.max_bytes)
        content.append(f"depends {files[f'depends {number}'][1]}")
    truth, problem = "", ""
    if job.truth:
        try:
            truth = _truth(job.truth, setup, files)
        except ImageReadError as error:
            truth, problem = f"unreadable {error.reason}", f"truth: {error}"
    return JobFiles(data, before, Digests(" ".join(content), truth, files), problem)


def _optional(path: str, max_bytes: int) -> tuple[bytes, File]:
    """Content and entry of a file that may be absent."""
    mark = mark_of(path)
    try:
        data = read_input(path, max_bytes)
    except ImageReadError:
        data = b""
    return data, (place_of(path), digest(data), mark)


def _truth(path: str, setup: Setup, files: dict[str, File]) -> str:
    mark = mark_of(path)
    try:
        found = digest(read_input(path, setup.max_bytes))
    except ImageReadError as error:
        text = f"the true mask {printable(display_path(path))} cannot be used: {error.reason}: {error}"
        raise ImageReadError("truth", text) from error
    files["truth"] = (place_of(path), found, mark)
    return found + ("" if setup.truth_label is None else f" label {setup.truth_label}")


def kept_outputs(record: Record | None, read: JobFiles, out: str) -> tuple[str, ...] | None:
    """Recorded outputs that are there with the content they were given; None when they were made from other files."""
    if record is None or record.content != read.digests.content:
        return None
    outputs = record.outputs.items()
    return tuple(path for path, (made, _) in outputs if _standing_digest(out, path, record.members.get(path)) == made)


def output_stands(out: str, path: str, seen: tuple[str, Mark], member: Member | None) -> bool:
    """Whether an output is what was written, as `seen` says: a file, told by its mark if that is the same, or a member."""
    if member is None:
        return unchanged(os.path.join(out, path), *seen)
    return _standing_digest(out, path, member) == seen[0]


def _standing_digest(out: str, path: str, member: Member | None) -> str:
    """As `output_digest`; empty, too, of a member whose header, by which ``tar`` finds it, is not what was written."""
    if member is not None:
        pack, offset, length = member
        size = head_size(path)
        if output_digest(out, path, (pack, offset - size, size)) != digest(head(path, length)):
            return ""
    return output_digest(out, path, member)


def still_true(files: Mapping[str, File]) -> str:
    """Which of the files something was made from has changed or gone since, without its true mask; else empty.

    A file whose size and time of change are what they were is not read again.
    """
    return next((file[0] for role, file in files.items() if role != "truth" and not unchanged(*file)), "")


def unchanged(path: str, digest: str, mark: Mark) -> bool:
    """Whether a file has the content it had: told by its mark, else by reading it."""
    now = mark_of(path)
    if now == (-1, -1):
        return mark == now
    return now == mark or _content_digest(path) == digest


def _content_digest(path: str) -> str:
    """Digest of a file or member; empty when it cannot be read."""
    if split_member_path(path)[2] is None:
        return output_digest("", path)
    try:
        return digest(read_input(path, _MAX_BYTES))
    except ImageReadError:
        return ""
