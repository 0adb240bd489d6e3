"""The Dask executor: the same tree as with processes, and what is left when a worker, the scheduler or the run dies."""

import contextlib
import gc
import json
import multiprocessing
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import stand_in
from batches import Silent, make_images, run_batch, snapshot, table
from commands import Command

from ffseg.batch.executors import dask, held
from ffseg.batch.executors.base import Assignment
from ffseg.batch.executors.processes import Processes
from ffseg.batch.outputs.table import Products
from ffseg.batch.plan.sources import InputImage, Job
from ffseg.batch.workers.launch import Process, launch
from ffseg.batch.workers.messages import Setup, Task
from ffseg.errors import UsageError, WorkerLostError
from ffseg.parameter_files import load_params
from tests.campaigns import harness

pytest.importorskip("distributed")
pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own, of every kind

NAMES = [f"i{index}.png" for index in range(60)]
ALL = Products(True, ("coco",))


@pytest.fixture(autouse=True)
def no_client_left() -> Iterator[None]:
    """Clients that never connected end here: collected while another one starts, they would wait for it for ever."""
    yield
    gc.collect()


Scheduler = tuple[str, list[subprocess.Popen[bytes]]]


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scheduler]:
    with started(tmp_path_factory) as found:
        yield found


@pytest.fixture
def mortal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scheduler]:
    with started(tmp_path_factory) as found:
        yield found


@contextlib.contextmanager
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scheduler]:
    """A scheduler with two workers, each a process of its own."""
    file = tmp_path_factory.mktemp("dask") / "scheduler.json"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    worker = ("worker", "--nthreads", "1", "--no-nanny")
    processes = []
    for name, *options in (("scheduler", "--host", "127.0.0.1", "--port", "0"), worker, worker):
        command = [sys.executable, "-m", f"distributed.cli.dask_{name}", "--scheduler-file", file, "--no-dashboard"]
        processes.append(subprocess.Popen([*command, *options], env=environment, stderr=subprocess.DEVNULL))
    try:
        yield address_in(file), processes
    finally:
        for process in processes:
            process.kill()
            process.wait()


def address_in(file: Path) -> str:
    """Address of the scheduler that writes this file, once it is whole."""
    until = time.monotonic() + 60
    while time.monotonic() < until:
        with contextlib.suppress(FileNotFoundError, json.JSONDecodeError):
            return json.loads(file.read_text())["address"]
        time.sleep(0.05)
    raise TimeoutError("the scheduler has not started")


def listening() -> socket.socket:
    """A server that does not wait for ever for whom nobody sends."""
    server = socket.create_server(("127.0.0.1", 0))
    server.settimeout(60)
    return server


def by_dask(address: str, chunk: int = 10) -> dict[str, object]:
    return {"executor": "dask", "scheduler": address, "chunk": chunk, "num_workers": 2}


def offspring(processes: list[subprocess.Popen[bytes]]) -> list[str]:
    found = []
    for path in [path for process in processes for path in Path(f"/proc/{process.pid}/task").glob("*/children")]:
        with contextlib.suppress(OSError):  # of a thread that has ended meanwhile
            found += path.read_text().split()
    return found


def tree(out: Path) -> dict[str, bytes]:
    return {**snapshot(out), "coco.json": (out / "coco.json").read_bytes()}


def test_the_tree_is_that_of_processes(scheduler, tmp_path: Path) -> None:
    make_images(tmp_path / "in", NAMES, {NAMES[5]: stand_in.FAIL, NAMES[7]: stand_in.CRASH, NAMES[9]: stand_in.DEFECT})
    run_batch(tmp_path / "in", tmp_path / "one", products=ALL, num_workers=2)
    summary = run_batch(tmp_path / "in", tmp_path / "dask", products=ALL, **by_dask(scheduler[0]))
    assert (summary.done, summary.failed) == (57, 3), "a crash costs its image alone"
    assert tree(tmp_path / "dask") == tree(tmp_path / "one")
    errors = [{row["image"]: row["error"] for row in table(tmp_path / out / "timings.csv")} for out in ("one", "dask")]
    assert errors[0] == errors[1]
    assert run_batch(tmp_path / "in", tmp_path / "dask", products=ALL, **by_dask(scheduler[0])).unchanged == 57
    assert not list((tmp_path / "dask" / ".ffseg" / "chunks").iterdir())
    versions = [json.loads((tmp_path / out / "run.json").read_text())["versions"] for out in ("one", "dask")]
    assert versions[0] == versions[1] != {}, "also of a worker process that an earlier chunk or run has left"
    packed = replace(ALL, pack=True)
    for name, how in (("one tar", {"num_workers": 2}), ("dask tar", by_dask(scheduler[0]))):
        assert run_batch(tmp_path / "in", tmp_path / name, products=packed, **how).done == 57
    one, other = (
        {path.name: path.read_bytes() for path in (tmp_path / name).glob("*.tar")} for name in ("one tar", "dask tar")
    )
    assert (one, sorted(one)) == (other, ["coco.tar", "contours.tar", "masks.tar", "overlays.tar"])


def test_a_stopped_run_goes_on_where_it_was(scheduler, tmp_path: Path) -> None:
    make_images(tmp_path / "in", NAMES)
    first = run_batch(tmp_path / "in", tmp_path / "out", observer=Silent(last=10), **by_dask(scheduler[0]))
    assert first.signal == 15
    assert 10 <= first.done < 60
    assert first.failed == 0
    masks = list((tmp_path / "out" / "masks").rglob("*.png"))
    assert first.done == len(table(tmp_path / "out" / "timings.csv")) >= len(masks) - 2  # two workers may be at one
    second = run_batch(tmp_path / "in", tmp_path / "out", **by_dask(scheduler[0]))
    assert second.done + second.unchanged == 60
    assert second.unchanged >= first.done
    run_batch(tmp_path / "in", tmp_path / "one", num_workers=2)
    assert snapshot(tmp_path / "out") == snapshot(tmp_path / "one")


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
@pytest.mark.parametrize("last", [1 << 60, 10], ids=["done", "stopped"])
def test_a_run_that_is_over_leaves_no_process_on_the_machines(scheduler, tmp_path: Path, last: int) -> None:
    make_images(tmp_path / "in", NAMES)
    address, processes = scheduler
    worked: list[str] = []

    class Looking(Silent):
        def finished(self, job, status: str, error: str) -> None:
            worked.extend(offspring(processes))
            super().finished(job, status, error)

    run_batch(tmp_path / "in", tmp_path / "out", observer=Looking(last), **by_dask(address))
    until = time.monotonic() + 30  # a chunk that nobody wants any more ends with its image
    while offspring(processes) and time.monotonic() < until:
        time.sleep(0.02)
    assert worked
    assert offspring(processes) == []


class Ended:
    def __init__(self) -> None:
        self.closed = threading.Event()

    def close(self) -> None:
        self.closed.set()


def test_what_nobody_gives_a_chunk_any_more_ends_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(held, "IDLE_S", 0.01)
    idle = [Ended(), Ended()]
    for number, executor in enumerate(idle):
        held._keep(held.HeldProcess(f"setup {number}", executor))
    assert all(executor.closed.wait(30) for executor in idle)
    assert held._idle == []


def test_a_scheduler_that_is_not_there_is_refused(tmp_path: Path) -> None:
    make_images(tmp_path / "in", NAMES[:2])
    with pytest.raises(UsageError, match="no scheduler answers"):
        run_batch(tmp_path / "in", tmp_path / "out", **by_dask("nowhere:not-a-port"))
    with listening() as other:  # the dashboard, whose first bytes are no length
        answer = threading.Thread(target=lambda: other.accept()[0].sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n"))
        answer.start()
        with pytest.raises(UsageError, match="no scheduler answers"):
            run_batch(tmp_path / "in", tmp_path / "out", **by_dask(f"127.0.0.1:{other.getsockname()[1]}"))
        answer.join()


def test_a_run_that_waits_for_a_scheduler_is_stopped_at_once(tmp_path: Path) -> None:
    make_images(tmp_path / "in", NAMES[:2])
    with listening() as silent:
        asked = ["--executor", "dask", "--dask", f"127.0.0.1:{silent.getsockname()[1]}"]
        line = [sys.executable, "-m", "ffseg", "run", str(tmp_path / "in"), "--out", str(tmp_path / "out"), *asked]
        with subprocess.Popen(line, stderr=subprocess.PIPE, text=True) as run:
            silent.accept()
            run.send_signal(signal.SIGTERM)
            _, said = run.communicate(timeout=10)  # of the 20 s that a scheduler may take
    assert (run.returncode, "interrupted; run it again" in said, "error" in said) == (143, True, False)


def test_a_worker_that_dies_costs_nothing(mortal, tmp_path: Path) -> None:
    make_images(tmp_path / "in", NAMES)
    address, processes = mortal

    class Killing(Silent):
        def finished(self, job, status: str, error: str) -> None:
            super().finished(job, status, error)
            if len(self.heard) == 5:
                processes[1].kill()

    summary = run_batch(tmp_path / "in", tmp_path / "out", observer=Killing(), **by_dask(address, 5))
    assert (summary.done, summary.failed) == (60, 0)
    run_batch(tmp_path / "in", tmp_path / "one", num_workers=2)
    assert snapshot(tmp_path / "out") == snapshot(tmp_path / "one")


def test_a_dying_scheduler_ends_the_run_and_the_next_goes_on(mortal, ffseg_process: Command, tmp_path: Path) -> None:
    make_images(tmp_path / "in", NAMES, {NAMES[-1]: stand_in.HANG})  # so that the run cannot be done before
    address, processes = mortal
    out = tmp_path / "out"

    def run(out: Path, *options: str) -> subprocess.CompletedProcess[str]:
        command = ("run", tmp_path / "in", "--out", out, "--set", f"method={stand_in.METHOD}", *options)
        return ffseg_process(*command, env=harness.TESTS)

    def kill() -> None:
        while not any(path.stat().st_size > 500 for path in out.glob(".ffseg/chunks/*.jsonl")):
            time.sleep(0.002)
        processes[0].kill()

    threading.Thread(target=kill, daemon=True).start()
    gone = run(out, "--quiet", "--dask", address, "--chunk", "60")
    assert gone.returncode == 1
    (line,) = gone.stderr.splitlines()  # no traceback of Dask's
    assert re.match("ffseg: error: the Dask scheduler is gone.*; run again to go on$", line)
    make_images(tmp_path / "in", NAMES)
    rest = json.loads(run(out, "--json").stdout)["counts"]
    assert rest["done"] + rest["unchanged"] == 60
    assert rest["unchanged"] > 0, "what was written down of the chunk is not done again"
    assert (run(tmp_path / "one").returncode, snapshot(out)) == (0, snapshot(tmp_path / "one"))


def test_a_cluster_of_this_machine_is_started_where_none_is_named(tmp_path: Path) -> None:
    before = harness.children(os.getpid())  # a browser of other tests may still be open
    make_images(tmp_path / "in", NAMES, {NAMES[7]: stand_in.CRASH})
    summary = run_batch(tmp_path / "in", tmp_path / "out", executor="dask", num_workers=2)
    assert (summary.done, summary.failed) == (59, 1)
    run_batch(tmp_path / "in", tmp_path / "one", num_workers=2)
    assert (snapshot(tmp_path / "out"), multiprocessing.active_children()) == (snapshot(tmp_path / "one"), [])
    assert set(harness.children(os.getpid())) <= set(before), "no worker process is left behind"


def test_a_stopped_run_waits_for_no_image(tmp_path: Path) -> None:
    before = harness.children(os.getpid())  # a browser of other tests may still be open
    make_images(tmp_path / "in", NAMES, {NAMES[10]: stand_in.HANG})  # the first of the second worker
    how = {"executor": "dask", "num_workers": 2}
    assert run_batch(tmp_path / "in", tmp_path / "out", observer=Silent(last=10), **how).signal == 15
    assert held._busy == set(), "whoever waited for it has heard that it ended"
    assert set(harness.children(os.getpid())) <= set(before), "no worker process is left behind"


def test_a_worker_being_started_at_the_stop_ends_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_images(tmp_path, NAMES[:1], {NAMES[0]: stand_in.HANG})
    executor = Processes(Assignment(Setup(params=load_params(), segmenter=stand_in.NAME)))

    def started() -> Process:
        process = launch()
        executor.interrupt()
        return process

    monkeypatch.setattr("ffseg.batch.executors.processes.launch", started)
    job = Job(0, InputImage(str(tmp_path / NAMES[0]), NAMES[0]), "i0")
    executor.put(Task(job, str(tmp_path), ("masks/i0.png", "contours/i0.svg")))
    assert list(executor.replies(20_000)) == []  # the process is handed the image, and its end is heard of
    with pytest.raises(WorkerLostError, match="told to end"):
        list(executor.replies(20_000))
    executor.close()


def test_chunks_become_smaller_as_less_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: list[int] = []
    real = dask.Dask._submit

    def noted(executor: dask.Dask) -> None:
        sizes.append(len(executor._chunk))
        real(executor)

    monkeypatch.setattr(dask.Dask, "_submit", noted)
    make_images(tmp_path / "in", [f"{index}.png" for index in range(150)])
    summary = run_batch(tmp_path / "in", tmp_path / "out", executor="dask", chunk=17, num_workers=2)
    assert summary.done == sum(sizes) == 150
    assert sizes[:3] == [17, 17, 15], "the most that is asked for, then an eighth of what is left"
    assert sizes[-2] == dask.MIN_CHUNK


def test_a_cluster_of_this_machine_is_open_to_no_other() -> None:
    client, cluster = dask._connect(Assignment(Setup(params=load_params())))
    try:
        servers = [cluster.scheduler.http_server, *(worker.http_server for worker in cluster.workers.values())]
        places = [one.getsockname()[0] for server in servers for one in server._sockets.values()]
        assert len(places) >= 2
        assert set(places) == {"127.0.0.1"}
    finally:
        client.close()
        cluster.close(timeout=5)
