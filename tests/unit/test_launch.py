"""Start of workers: as copies of a light process, or as new ones; what they have of their parent and what not."""

import ctypes
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ffseg.batch.executors.base import Assignment, Options
from ffseg.batch.executors.processes import Processes
from ffseg.batch.workers import launch as launching
from ffseg.batch.workers.messages import Setup
from ffseg.bench.drawing import draw
from ffseg.io.masks import encode_png
from ffseg.parameter_files import load_params

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are copies on Linux only")

WORK = """
import json, os, sys, threading
from ffseg.batch.workers.launch import Forked, launch

{before}
held = os.open(os.devnull, os.O_RDONLY)
worker = launch()
seen = {{"forked": isinstance(worker.handle, Forked), "heavy": "numpy" in sys.modules}}
from ffseg.batch.plan.sources import InputImage, Job
from ffseg.batch.workers.messages import Setup, Task, received_messages, send
from ffseg.parameter_files import load_params

def faults():
    fields = open(f"/proc/{{worker.handle.pid}}/stat").read().rpartition(")")[2].split()
    return int(fields[7])

send(worker.tasks, Setup(params=load_params()))
replies = received_messages(worker.replies)
seen["ready"] = type(next(replies)).__name__
names = ("masks/0.png", "contours/0.svg")
counts = []
for index in range(8):
    send(worker.tasks, Task(Job(index, InputImage(sys.argv[1], "0.png"), "0"), "out", names))
    reply = next(replies)
    counts.append(faults())
seen["faults"] = [after - before for before, after in zip(counts[3:], counts[4:])]
seen["status"] = type(reply).__name__
files = f"/proc/{{worker.handle.pid}}/fd"
seen["files"] = len(os.listdir(files))
seen["stdin"] = os.readlink(files + "/0")
worker.handle.kill()
seen["codes"] = [worker.handle.wait(), worker.handle.wait()]
worker.end()
worker.end()
print(json.dumps(seen))
"""


def work(image: Path, before: str = "") -> dict[str, Any]:
    return json.loads(printed(WORK.format(before=before), str(image)))


def printed(code: str, *arguments: str) -> str:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def image(tmp_path: Path) -> Path:
    (tmp_path / "a.png").write_bytes(encode_png(draw(1).image, []))
    return tmp_path / "a.png"


THREAD = "threading.Thread(target=threading.Event().wait, daemon=True).start()"


@pytest.mark.parametrize("before", ["", "import numpy", THREAD])
def test_worker_is_a_copy_of_a_light_process_only(before: str, image: Path) -> None:
    seen = work(image, before)
    assert (seen["forked"], seen["ready"], seen["status"]) == (before == "", "Ready", "Done")
    assert seen["heavy"] == ("numpy" in before)
    assert (seen["files"], seen["stdin"]) == (5, "/dev/null")  # its streams and two pipes, nothing of the parent's
    assert seen["codes"] == [-9, -9]


def test_worker_keeps_the_memory_of_one_image_for_the_next(tmp_path: Path) -> None:
    if not hasattr(ctypes.CDLL(None), "mallopt"):
        pytest.skip("this C library cannot be told")
    (tmp_path / "a.png").write_bytes(encode_png(draw(1, 1600, 1200).image, []))
    # given back, the buffers of 1600x1200 pixels are 10,000 pages of every image; kept, those an image touches first
    assert min(work(tmp_path / "a.png")["faults"]) < 1000


def test_what_is_loaded_before_the_first_worker_starts_is_light() -> None:
    code = "import sys, ffseg.batch.workers.launch as it; it.launch().end(); print(*sys.modules)"
    assert {"numpy", "cv2", "yaml", "typer"}.isdisjoint(printed(code).split())
    code = "import sys, ffseg.batch.workers.work; print(*sys.modules)"
    assert {"yaml", "typer", "tarfile", "ffseg.camera.calibration", "ffseg.batch.runner"}.isdisjoint(
        printed(code).split()
    )


def test_of_the_processes_that_are_started_no_more_are_used_than_asked_for() -> None:
    """Films whose frames need the one before went through two processes at once: every run gave other masks."""
    started = [launching.launch(), launching.launch()]
    executor = Processes(Assignment(Setup(params=load_params()), Options(num_workers=1), started))
    try:
        assert [worker.process for worker in executor._workers] == started[:1]
    finally:
        executor.close()
        for process in started:
            process.end()


def test_this_process_is_not_copied() -> None:
    assert not launching.can_fork()  # it has NumPy


def test_a_copy_that_cannot_start_leaves_its_words() -> None:
    code = (
        "import os, ffseg.batch.workers.process as process\n"
        "from ffseg.batch.workers.launch import launch\n"
        "def main(*_): raise RuntimeError('no such luck')\n"
        "process.main = main\n"
        "worker = launch()\nassert worker.handle.wait() == 1\n"
        "print(os.pread(worker.log, 10000, 0).decode())"
    )
    assert "RuntimeError: no such luck" in printed(code)
