"""Executor on a Dask cluster: chunks of images, read and written on storage that all machines share."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pickle
import queue
import select
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib import import_module
from time import monotonic
from typing import Any

from ffseg.batch.executors.base import Assignment, Executor, serve
from ffseg.batch.executors.chunks import Chunks, replies, reply_line
from ffseg.batch.executors.held import end_idle, interrupt, lend, worker_process
from ffseg.batch.tar.members import digest
from ffseg.batch.tar.writer import Store
from ffseg.batch.workers.messages import Done, Event, Failed, Note, Ready, Reply, Setup, Task
from ffseg.errors import OutputError, UsageError, WorkerLostError
from ffseg.io.files import printable, remove_files
from ffseg.plugins import require

CHUNKS_EACH = 4
"""Chunks of a worker that what is left is cut into, so that all workers end at about the same time."""
MIN_CHUNK = 10
"""Images of a chunk, while there are so many: a chunk on its way costs about as much as one of them."""
CHUNKS_AHEAD = 2
"""Chunks of each worker that are on their way at once."""
_LOOPBACK = "127.0.0.1:0"
"""Where pages of a cluster of this machine are: without a place of their own, Dask opens them to the network."""
_QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.scheduler.work-stealing": False,
    "distributed.scheduler.active-memory-manager.start": False,
}
"""Of a cluster in this process, which nobody watches: its looking after itself took as long as its work."""
_TICK_MS = 100
_ANSWER_TIMEOUT_S = 20
"""Seconds a scheduler may take to answer."""
_CLOSE_TIMEOUT_S = 5
"""Seconds that workers may take to hear that a run is over."""


@dataclass(frozen=True, slots=True)
class ChunkOrder:
    """What a machine is told of a chunk."""

    setup: Setup
    timeout: float
    """Seconds an image may take."""
    settings: str
    """Digest of the parameters."""
    key: str
    """Digest of the setup and the seconds: what a worker process was started for."""
    path: str
    """File of the chunk."""
    going: str
    """File that is there as long as the chunk is wanted."""
    tasks: tuple[Task, ...]


class Dask(Executor):
    """An executor that hands chunks to the workers of a Dask cluster.

    Parameters
    ----------
    start : Assignment
        Its options name a scheduler; without one, a cluster of this machine is started.
    """

    def __init__(self, start: Assignment) -> None:
        require("distributed", "--executor dask needs distributed", "dask")
        self._start = start
        self._client, self._cluster = _connect(start)
        workers = max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]), start.options.num_workers)
        self._key = digest(pickle.dumps((start.setup, start.options.timeout)))
        if self._cluster is not None:
            lend(self._key, start)
        self._parts, self._left = workers * CHUNKS_EACH, start.num_tasks
        self._size = self._next_size()
        self._most = self._size * workers * CHUNKS_AHEAD
        self._chunks = Chunks.begin(start.state)
        self._chunk: list[Task] = []
        self._waiting: dict[Any, tuple[tuple[Task, ...], int]] = {}
        self._ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._number = 0
        self._greeted = False
        self._poll = select.poll()
        if start.stop >= 0:
            self._poll.register(start.stop, select.POLLIN)

    def room(self) -> int:
        return self._most - len(self._chunk) - sum(len(tasks) for tasks, _ in self._waiting.values())

    def put(self, task: Task) -> None:
        self._chunk.append(task)
        if len(self._chunk) == self._size:
            self._submit()

    def _next_size(self) -> int:
        """Images of the next chunk: fewer as fewer are left."""
        return min(self._start.options.chunk, max(MIN_CHUNK, -(-self._left // self._parts)))

    def _submit(self) -> None:
        tasks, self._chunk = tuple(self._chunk), []
        self._left -= len(tasks)
        self._size = self._next_size()
        start, self._number = self._start, self._number + 1
        path = self._chunks.path(self._number)
        order = ChunkOrder(
            start.setup, start.options.timeout, start.settings, self._key, path, self._chunks.going, tasks
        )
        future = self._client.submit(do_chunk, order, pure=False)
        self._waiting[future] = (tasks, self._number)
        future.add_done_callback(self._ended.put)

    def replies(self, most: int | None = None) -> Iterator[Event]:
        """As `Executor.replies`; of a whole chunk at once.

        Raises
        ------
        WorkerLostError
            If the scheduler is gone.
        """
        if self._chunk and self.room() > 0:  # there is nothing more to come
            self._submit()
        future = self._next(most)
        if future is not None:
            yield from self._finished(future)

    def _next(self, most: int | None) -> Any:  # noqa: ANN401 - Dask's future
        """A future that has ended; None when there is none in time, or the run is to end."""
        until = None if most is None else monotonic() + most / 1000
        while True:
            with contextlib.suppress(queue.Empty):
                return self._ended.get(timeout=_TICK_MS / 1000)
            if self._poll.poll(0) or (until is not None and monotonic() > until):
                return None
            if self._client.status not in ("running", "connecting") and self._ended.empty():
                raise WorkerLostError("the Dask scheduler is gone; run again to go on")

    def _finished(self, future: Any) -> Iterator[Event]:  # noqa: ANN401 - Dask's future
        tasks, number = self._waiting.pop(future)
        if future.status == "cancelled":
            raise WorkerLostError("the Dask scheduler is gone or has lost its tasks; run again to go on")
        error = future.exception()
        if isinstance(error, UsageError):
            raise error
        if error is None:
            versions = future.result()
            if versions and not self._greeted:
                self._greeted = True
                yield Ready(versions)
        else:
            yield Note(f"a chunk of {len(tasks)} images was lost: {type(error).__name__}: {error}"[:300])
        found = dict(replies(self._chunks.path(number), self._start.settings))
        lost = Failed(0, "crash", "the workers that had it ended before it was done; run again to try it again")
        for task in tasks:
            yield replace(found.get(task.job.source.name, lost), index=task.job.index)
        remove_files([self._chunks.path(number)])

    def close(self) -> None:
        """As `Executor.close`; what workers have written down of unfinished chunks stays."""
        self._chunks.end()
        if self._cluster is not None:  # an image may take long, and nobody wants it
            interrupt()
        with contextlib.suppress(Exception):  # a scheduler that is gone cannot be told
            self._client.cancel(list(self._waiting), force=True)
        if self._cluster is None and self._client.status == "running":
            with contextlib.suppress(Exception):
                self._client.run(end_idle, self._key, on_error="ignore", callback_timeout=_CLOSE_TIMEOUT_S)
        with contextlib.suppress(Exception):
            self._client.close(timeout=2)
        if self._cluster is not None:
            with contextlib.suppress(Exception):
                self._cluster.close(timeout=5)
            end_idle()


def _connect(start: Assignment) -> tuple[Any, Any]:
    """Client, and the cluster of this machine when there is no other."""
    import logging

    config: Any = import_module("dask").config
    distributed: Any = import_module("distributed")
    for name in [*logging.root.manager.loggerDict, "distributed", "tornado"]:  # some have levels of their own
        if name.partition(".")[0] in ("distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters is told by the run
    config.set({"distributed.comm.timeouts.connect": _ANSWER_TIMEOUT_S, "distributed.scheduler.worker-saturation": 1.0})
    address = start.options.scheduler
    cluster = None
    if not address:  # workers that are threads: each has a process of ours that works on the images
        config.set(_QUIET)
        cluster = distributed.LocalCluster(
            n_workers=start.options.num_workers,
            threads_per_worker=1,
            processes=False,
            memory_limit=0,
            dashboard_address=_LOOPBACK,
            worker_dashboard_address=_LOOPBACK,
        )
    try:
        if address:
            with ThreadPoolExecutor(1) as thread:  # a notebook's own has a loop already
                thread.submit(asyncio.run, _require_scheduler(address, start.stop)).result()
        return distributed.Client(cluster or address, timeout=_ANSWER_TIMEOUT_S, set_as_default=False), cluster
    except (asyncio.CancelledError, Exception) as error:  # what answers may be anything, and Dask read anything into it
        if start.stop >= 0 and select.select([start.stop], [], [], 0)[0]:  # what was cut off may end as any of them
            raise KeyboardInterrupt from error
        raise UsageError(
            f"--dask: no scheduler answers at {printable(address)} ({str(error) or type(error).__name__}); check the address"
        ) from error


async def _require_scheduler(address: str, stop: int) -> None:
    """Refuse what is none: with other servers, as of the dashboard, a client waits for minutes."""
    distributed: Any = import_module("distributed")
    task = asyncio.current_task()
    if stop >= 0 and task is not None:
        asyncio.get_running_loop().add_reader(stop, task.cancel)
    secured = distributed.Security().get_connection_args("client")
    async with distributed.rpc(address, timeout=_ANSWER_TIMEOUT_S, connection_args=secured) as there:
        found = (await asyncio.wait_for(there.identity(), _ANSWER_TIMEOUT_S))["type"]
    if found != "Scheduler":
        raise ValueError(f"it is a {found}")


def do_chunk(order: ChunkOrder) -> dict[str, str]:
    """Do the images of a chunk that are not done yet; runs on a worker of the cluster.

    Returns
    -------
    dict
        Versions a result can depend on.
    """
    done = {name for name, _ in replies(order.path, order.settings)}
    left = [task for task in order.tasks if task.job.source.name not in done]
    out, state = order.tasks[0].out, os.path.dirname(os.path.dirname(order.path))
    with (
        worker_process(order.key, order.setup, order.timeout, order.going) as held,
        open(order.path, "ab", buffering=0) as file,  # noqa: PTH123 - append
        contextlib.closing(Store(out, state, packed=order.setup.products.pack)) as store,
    ):
        file.write(b"\n")  # after a line that a dead worker has not finished
        names = {task.job.index: task.job.source.name for task in left}
        for event in serve(held.executor, iter(left), lambda: os.path.exists(order.going), lambda: None):
            if isinstance(event, Ready):
                held.versions = event.versions
            elif isinstance(event, Reply):
                file.write(reply_line(names[event.index], order.settings, _written(event, store)))
    return held.versions


def _written(reply: Reply, store: Store) -> Reply:
    """A reply whose outputs are on the disk."""
    if not isinstance(reply, Done):
        return reply
    try:
        members = store.write([(one.path, one.data) for one in reply.outputs if one.data is not None])
    except OutputError as error:
        return Failed(reply.index, "output", str(error))
    placed = (replace(one, data=None, member=members.get(one.path)) for one in reply.outputs)
    return replace(reply, outputs=tuple(placed))
