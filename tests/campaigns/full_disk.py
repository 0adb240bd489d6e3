"""R6: outputs that do not fit, on a small tmpfs or under a limit on the size of a file.

``python -m tests.campaigns.full_disk --work DIR [--images 12] [--pack]``

For every size of the disk, and every limit, the run ends with exit code 2 before the first image or with 3 and the reason,
each output is whole, and no temporary file is left. The tmpfs is mounted in a namespace of its own (``unshare``, Linux).
"""

import errno
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from tests.campaigns import harness

DISKS_KB = (4, 16, 48, 64, 72, *range(80, 400, 16), 1024, 4096)
"""From a disk without room for the state folder to one that takes everything."""
FILE_LIMITS = (0, 1, 100, 200, 500, 1000, 2000, 4000, 8000, 16000, 65535, 65536, 1 << 17, 1 << 20)
"""Bytes a file may have."""
REASONS = tuple(os.strerror(code) for code in (errno.ENOSPC, errno.EFBIG))
_ON_TMPFS = """
size=$1 out=$2 snapshot=$3; shift 3
mount -t tmpfs -o size="$size" tmpfs "$out" || exit 99
"$@"; code=$?
cp -a "$out" "$snapshot"
exit $code
"""


@dataclass
class Figures(harness.Figures):
    """And how long a refusal took."""

    slowest_refusal_s: float = 0.0
    slowest_refusal_processor_s: float = 0.0


def campaign(work: harness.Work, images: int = 12, *, pack: bool = False) -> Figures:
    """Run into every disk and under every limit."""
    source, straight, figures = work / "in", work / "straight", Figures()
    harness.draw_blobs(source, images)
    options = ("--set", harness.CONFIG, "--overlay", "--jobs", "1", "-q", *(harness.PACK if pack else ()))
    assert harness.run("run", source, "--out", straight, *options).code == 0
    reference = harness.outputs(straight)
    command = harness.command("run", source, "--out", work / "out", *options)
    for kilobytes in DISKS_KB:
        out, snapshot = _fresh(work / "out"), _fresh(work / "snapshot")
        out.mkdir()
        places = (f"{kilobytes}k", os.fspath(out), os.fspath(snapshot))
        ended = harness.ended(["unshare", "-rm", "sh", "-c", _ON_TMPFS, "sh", *places, *command])
        _judge(ended, snapshot, reference, figures, f"disk of {kilobytes} kB")
    for limit in FILE_LIMITS:
        out = _fresh(work / "out")
        ended = harness.ended(["sh", "-c", 'trap "" XFSZ; exec "$@"', "sh", "prlimit", f"--fsize={limit}", *command])
        _judge(ended, out, reference, figures, f"files of {limit} bytes")
    return figures


def _fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    return folder


def _judge(ended: harness.Ended, out: Path, reference: dict[str, bytes], figures: Figures, label: str) -> None:
    figures.judge(label, ended, out, REASONS)
    found = harness.outputs(out)
    partial = [name for name, data in found.items() if data != reference[name]]
    if partial:
        figures.wrong.append(f"{label}: {partial} not whole")
    if ended.code == 0 and len(found) != len(reference):
        figures.wrong.append(f"{label}: exit 0 with {len(found)} of {len(reference)} files")
    elif ended.code == 2:
        figures.slowest_refusal_s = max(figures.slowest_refusal_s, ended.seconds)
        figures.slowest_refusal_processor_s = max(figures.slowest_refusal_processor_s, ended.processor_s)
        if found:
            figures.wrong.append(f"{label}: exit 2 after {len(found)} files")


if __name__ == "__main__":
    harness.as_command(campaign)
