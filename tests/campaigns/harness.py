"""What the campaigns share: small image folders, the command as a process, and a figure for each promise."""

import functools
import os
import signal
import subprocess
import sys
import tarfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Annotated

import numpy as np
import typer

KINDS = (("masks", ".png"), ("contours", ".svg"))
CONFIG = "init.radius=8"
"""A start circle that lies inside the small images."""


@dataclass
class Figures:
    """What runs did that met a fault; `wrong` names each that broke a promise."""

    runs: int = 0
    exit_codes: Counter[int] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def judge(self, label: str, ended: "Ended", out: Path, reasons: Sequence[str]) -> None:
        """Count a run; it ends with an exit code of its own and a reason, and leaves no temporary file."""
        self.runs += 1
        self.exit_codes[ended.code] += 1
        if "Traceback" in ended.stderr or ended.code not in (0, 2, 3):
            self.wrong.append(f"{label}: exit {ended.code} {ended.stderr[-300:]}")
        if ended.code in (2, 3) and not any(reason in ended.stderr for reason in reasons):
            self.wrong.append(f"{label}: no reason in {ended.stderr[-300:]}")
        if temporaries(out):
            self.wrong.append(f"{label}: {temporaries(out)} left")


@dataclass(frozen=True)
class Ended:
    """How a command ended; the processor's time is not always taken."""

    code: int
    seconds: float
    stderr: str
    processor_s: float = 0.0


def command(*arguments: str | os.PathLike[str]) -> list[str]:
    return [sys.executable, "-m", "ffseg", *map(str, arguments)]


def milliseconds(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return (time.process_time() - begin) * 1e3


def run(*arguments: str | os.PathLike[str], env: Mapping[str, str] | None = None, limit: float = 300) -> Ended:
    return ended(command(*arguments), env, limit)


def ended(whole: Sequence[str], env: Mapping[str, str] | None = None, limit: float = 300) -> Ended:
    begin, before = time.perf_counter(), os.times()
    done = subprocess.run(whole, capture_output=True, timeout=limit, check=False, env={**os.environ, **(env or {})})
    seconds, now = time.perf_counter() - begin, os.times()
    processor = sum(now[2:4]) - sum(before[2:4])
    return Ended(done.returncode, seconds, done.stderr.decode("utf-8", "replace"), processor)


def start(*arguments: str | os.PathLike[str], stderr: int | IO[bytes] = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    """Start ``ffseg`` in a process group of its own."""
    return subprocess.Popen(
        command(*arguments), stdout=subprocess.DEVNULL, stderr=stderr, start_new_session=True, env=TESTS
    )


TESTS = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parent.parent)}
"""An environment in which ``stand_in`` can be imported."""


def endless(work: Path, images: int = 12) -> list[str | os.PathLike[str]]:
    """Arguments of a run into ``out`` that cannot end by itself, however late somebody looks: its last image hangs."""
    import stand_in
    from PIL import Image

    draw_blobs(work / "in", images)
    Image.fromarray(np.full((48, 64), stand_in.HANG, np.uint8)).save(work / "in" / "z.png")
    run: list[str | os.PathLike[str]] = ["run", work / "in", "--out", work / "out", "--jobs", "2"]
    return [*run, "--set", CONFIG, "--set", f"method={stand_in.METHOD}"]


def journal(out: Path) -> bytes:
    """What a run has written down so far."""
    path = out / ".ffseg" / "journal.jsonl"
    return path.read_bytes() if path.exists() else b""


def until_written(out: Path, images: int = 12) -> None:
    """Wait until so many images stand in the journal of a run."""
    until(lambda: journal(out).count(b"\n") > images)


def until(true: Callable[[], bool], patience: float = 120.0) -> None:
    end = time.monotonic() + patience
    while not true():
        if time.monotonic() > end:
            raise TimeoutError(f"not so within {patience:g} s")
        time.sleep(0.01)


def draw_blobs(folder: Path, count: int, first: int = 0) -> None:
    """Write `count` small images, each a bright region with its own shape and noise round the start of the contour."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    y, x = np.mgrid[:48, :64]
    for index in range(count):
        rng = np.random.default_rng(first + index)
        radius = 14 + 5 * np.sin(rng.integers(2, 5) * np.arctan2(y - 24, x - 32) + rng.uniform(0, 6))
        image = np.where(np.hypot(x - 32, y - 24) < radius, 180, 60) + rng.normal(0, 3, (48, 64))
        Image.fromarray(np.clip(image, 0, 255).astype(np.uint8)).save(folder / f"i{index}.png", compress_level=1)


def draw_film(path: Path, frames: int) -> Path:
    from drawn_films import pictures, write_film

    return write_film(path, pictures(frames, (64, 48), noise=3))


def outputs(out: Path) -> dict[str, bytes]:
    """Content of the masks and contours under an output folder, as files or in tar files, by relative path."""
    files = (path for kind, _ in KINDS for path in (out / kind).rglob("*") if path.is_file())
    found = {str(path.relative_to(out)): path.read_bytes() for path in files if not path.name.endswith(".tmp")}
    for path in (out / f"{kind}.tar" for kind, _ in KINDS):
        if path.exists():
            with tarfile.open(path) as archive:
                stored = ((member.name, archive.extractfile(member)) for member in archive)
                found |= {name: file.read() for name, file in stored if file}
    return found


def temporaries(out: Path) -> list[str]:
    """Names of temporary files left under an output folder."""
    return [str(path) for path in out.rglob("*") if path.name.startswith(".ffseg-")]


def group_is_gone(process: subprocess.Popen[bytes], patience: float = 20.0) -> bool:
    """Whether no process of a group started by `start` is left after a while.

    A worker that has just been started asks to die with the run when it comes to it, which a busy machine delays.
    """
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.02)
    return False


def kill(process: subprocess.Popen[bytes], number: int = signal.SIGKILL) -> int:
    """Send a signal to the command itself and wait for its end."""
    process.send_signal(number)
    return process.wait(timeout=120)


def resident_mb(pids: Sequence[int]) -> float:
    """Resident memory of processes, MB; those that are gone count nothing."""
    total = 0
    for pid in pids:
        try:
            total += int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
        except (OSError, IndexError):
            continue
    return total / 1e6


def children(pid: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


Work = Annotated[Path, typer.Option(help="Folder to work in, made if absent.")]
"""What most campaigns have to be given."""


def as_command(run: Callable[..., object]) -> None:
    """Run a function as a command with an option for each argument; a number that it gives is the exit code, else it is said."""

    @functools.wraps(run)
    def told(**options: object) -> None:
        found = run(**options)
        if isinstance(found, int):
            sys.exit(found)
        if found is not None:
            say(str(found))

    typer.run(told)


PACK = ("--pack", "tar")
"""What makes a campaign one of packed outputs."""


def say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
