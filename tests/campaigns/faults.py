"""R5: when the n-th open, write, fsync or rename fails, for every n, earlier outputs are kept and the path is named.

``python -m tests.campaigns.faults --work DIR [--errors ENOSPC,EIO,EACCES] [--pack]``

A library loaded before libc (``faults.c``, compiled here) makes the n-th call that touches the output folder fail.
"""

import errno
import itertools
import os
import shutil
import subprocess
from pathlib import Path

from tests.campaigns import harness

CALLS = ("open", "write", "fsync", "rename")


def build(work: Path) -> Path:
    work.mkdir(parents=True, exist_ok=True)
    library = work / "faults.so"
    source = Path(__file__).with_name("faults.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"], check=True)
    return library


def campaign(
    work: harness.Work,
    errors: str = "ENOSPC,EIO,EACCES",
    images: int = 3,
    call: str = "",
    number: int = 0,
    *,
    pack: bool = False,
) -> harness.Figures:
    """Fail each call once (or the one of a number), in a run that follows a good one of the same images with other contents."""
    options = ("--jobs", "1", "--set", harness.CONFIG, *(harness.PACK if pack else ()))
    library, figures = build(work), harness.Figures()
    before, after, prepared = work / "before", work / "after", work / "prepared"
    harness.draw_blobs(before, images)
    harness.draw_blobs(after, images, first=1)  # the same names, other pictures
    assert harness.run("run", before, "--out", prepared, "-q", *options).code == 0
    assert harness.run("run", after, "--out", work / "new", "-q", *options).code == 0
    known = (harness.outputs(prepared), harness.outputs(work / "new"))
    for name, each in itertools.product(errors.split(","), [call] if call else CALLS):
        for at in [number] if number else itertools.count(1):
            if not _one_fault(work, (library, (each, name, at)), options, known, figures):
                break
    return figures


def _one_fault(
    work: Path,
    fault: tuple[Path, tuple[str, str, int]],
    options: tuple[str, ...],
    known: tuple[dict[str, bytes], dict[str, bytes]],
    figures: harness.Figures,
) -> bool:
    """Whether the fault happened: once n is beyond the last call it does not."""
    (library, (call, name, number)), (old, new) = fault, known
    out, mark = work / "out", work / "hit"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(work / "prepared", out)
    mark.unlink(missing_ok=True)
    env = {
        "LD_PRELOAD": str(library), "FAULT_UNDER": str(out), "FAULT_CALL": call, "FAULT_NUMBER": str(number),
        "FAULT_ERRNO": str(getattr(errno, name)), "FAULT_MARK": str(mark),
    }  # fmt: skip
    ended = harness.run("run", work / "after", "--out", out, *options, env=env)
    if not mark.exists():
        return False
    label = f"{call} {number} {name}"
    figures.judge(label, ended, out, [os.strerror(getattr(errno, name))])
    found = harness.outputs(out)
    broken = [path for path in old if found.get(path) not in (old[path], new[path])]
    if broken:
        figures.wrong.append(f"{label}: {broken} neither old nor new")
    if ended.code in (2, 3) and str(out) not in ended.stderr:
        figures.wrong.append(f"{label}: path not named: {ended.stderr[-200:]}")
    again = harness.run("run", work / "after", "--out", out, "-q", *options)
    if again.code != 0 or harness.outputs(out) != new or list(out.rglob("packs/*")):
        figures.wrong.append(f"{label}: the next run does not complete it ({again.code})")
    return True


if __name__ == "__main__":
    harness.as_command(campaign)
