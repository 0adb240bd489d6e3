"""What Windows does not have is not asked for: neither when a module is imported, nor by a run in one process."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

LIKE_WINDOWS = """
import os, pkgutil, runpy, select, signal, subprocess, sys, tempfile, types
from importlib import import_module
import asyncio, concurrent.futures.process, ctypes, cv2, fcntl, http.server, multiprocessing.popen_fork, numpy, typer, yaml
lockf = fcntl.lockf  # the stand-in below still has to lock
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
for module, names in {
    os: "O_CLOEXEC O_NONBLOCK O_NOCTTY O_NOFOLLOW O_DIRECTORY fork pread pwrite sched_getaffinity posix_fadvise getuid "
        "memfd_create getloadavg statvfs mkfifo killpg setsid fchmod",
    signal: "SIGHUP SIGKILL SIGALRM SIGUSR1 setitimer",
    select: "poll epoll",
}.items():
    for name in names.split():
        delattr(module, name)
msvcrt = types.ModuleType("msvcrt")
msvcrt.LK_NBLCK = 2
msvcrt.locking = lambda descriptor, mode, length: lockf(descriptor, 6)  # exclusive, at once
sys.modules["msvcrt"] = msvcrt
sys.platform = "win32"
"""


def python(text: str, folder: Path) -> None:
    call = [sys.executable, "-c", LIKE_WINDOWS + text]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr


IMPORT_ALL = """
import ffseg
for one in pkgutil.walk_packages(ffseg.__path__, "ffseg."):
    if one.name != "ffseg.__main__":
        import_module(one.name)
"""
RUNS = f"""
def ffseg(*words):
    sys.argv = ["ffseg", *words]
    try:
        runpy.run_module("ffseg", run_name="__main__")
    except SystemExit as ended:
        assert not ended.code, ended.code
image = {str(ROOT / "samples" / "toy.png")!r}
ffseg("run", image, "--out", "out")
ffseg("run", image, "--out", "out", "--dry-run")
ffseg("run", image, "--out", "out", "--overlay")
ffseg("run", image, "--out", "packed", "--pack", "tar")
ffseg("run", "packed/masks.tar", "--out", "again")
ffseg("report", "out")
"""


def test_every_module_is_imported_without_what_windows_does_not_have(tmp_path: Path) -> None:
    python(IMPORT_ALL, tmp_path)


def test_a_run_locks_resumes_and_packs_without_what_windows_does_not_have(tmp_path: Path) -> None:
    python(RUNS, tmp_path)
    for path in ("out/overlays/toy.png", "out/report.html", "again/timings.csv"):
        assert (tmp_path / path).is_file(), path
