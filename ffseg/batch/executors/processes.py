"""Supervised worker processes: one that crashes or hangs costs its current image, and is replaced."""

from __future__ import annotations

import contextlib
import os
import select
import signal
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

from ffseg.batch.executors.base import Assignment, Executor
from ffseg.batch.workers.launch import Process, launch
from ffseg.batch.workers.messages import PIECE, Event, Failed, Inbox, Note, Ready, Refused, Reply, Task, send
from ffseg.errors import UsageError, WorkerLostError

TASKS_AHEAD = 2
"""Tasks a worker holds: the one it works on, and the next, so that it never waits while its last reply is written."""
_LOG_TAIL = 2000  # bytes of a dead worker's stderr worth keeping
_MAX_FAILED_STARTS = 3  # workers in a row that die before they are ready end the run


@dataclass(eq=False, slots=True)
class Worker:
    """One process and what it has been given."""

    process: Process
    ready: bool = False
    queue: deque[Task] = field(default_factory=deque)
    inbox: Inbox = field(default_factory=Inbox)
    since: float = 0.0

    def give(self, task: Task) -> None:
        """Send a task; a process that dies meanwhile is noticed when its replies end."""
        if not self.queue:
            self.since = monotonic()
        self.queue.append(task)
        self.send(task)

    def send(self, message: object) -> None:
        """Send anything."""
        with contextlib.suppress(BrokenPipeError):
            send(self.process.tasks, message)

    def log_tail(self) -> str:
        """Last lines the process wrote to its stderr."""
        size = os.fstat(self.process.log).st_size
        return (
            os.pread(self.process.log, _LOG_TAIL, max(0, size - _LOG_TAIL)).decode("utf-8", "backslashreplace").strip()
        )

    def clear_log(self) -> None:
        """Forget what decoders grumbled about an image that is done."""
        if os.fstat(self.process.log).st_size:
            os.ftruncate(self.process.log, 0)


class Processes(Executor):
    """Workers fed with tasks in order; replies come as they are ready."""

    def __init__(self, start: Assignment) -> None:
        self._setup, self._num_workers, self._timeout = start.setup, start.options.num_workers, start.options.timeout
        self._waiting: deque[Task] = deque()
        self._workers: list[Worker] = []
        self._poll = select.poll()
        self._stillborn = 0  # workers in a row that died before they were ready
        self._news: list[Event] = []
        self._interrupted = False
        if start.stop >= 0:
            self._poll.register(start.stop, select.POLLIN)
        for process in start.started[: self._num_workers]:
            self._adopt(process)

    def room(self) -> int:
        return self._num_workers * TASKS_AHEAD - len(self._waiting) - sum(len(worker.queue) for worker in self._workers)

    def put(self, task: Task) -> None:
        self._waiting.append(task)

    def replies(self, most: int | None = None) -> Iterator[Event]:
        """As `Executor.replies`.

        Raises
        ------
        UsageError
            If the setup does not work.
        WorkerLostError
            If workers died before they were ready, several in a row: it is not chance. Or after `interrupt`.
        """
        self._hand_out()
        events = self._poll.poll(self._patience(most))
        by_descriptor = {worker.process.replies: worker for worker in self._workers}
        for descriptor, _ in events:
            worker = by_descriptor.get(descriptor)
            if worker is not None:
                yield from self._read(worker)
        yield from self._overdue()
        news, self._news = self._news, []
        yield from news

    def close(self) -> None:
        """End every worker."""
        for worker in list(self._workers):
            self._drop(worker)

    def interrupt(self) -> None:
        """Kill every worker, also one that is just being started, and let there be no other.

        To be called from any thread: whoever waits for replies hears of it as of a crash, or is told that it is over.
        """
        self._interrupted = True
        for worker in list(self._workers):
            worker.process.handle.kill()

    def _hand_out(self) -> None:
        while self._waiting and (worker := self._next_worker()) is not None:
            worker.give(self._waiting.popleft())

    def _next_worker(self) -> Worker | None:
        """One without a task; else a new one while there may be more; else the one with room for the next task."""
        worker = min(self._workers, key=lambda worker: len(worker.queue), default=None)
        if len(self._workers) < self._num_workers and (worker is None or worker.queue):
            started = self._another()
            if started is not None:
                return started
        return worker if worker is not None and len(worker.queue) < TASKS_AHEAD else None

    def _another(self) -> Worker | None:
        """A further worker; None where the system lets there be no more, which is said once.

        Raises
        ------
        UsageError
            If there is no worker at all.
        WorkerLostError
            After `interrupt`.
        """
        if self._interrupted:
            raise WorkerLostError("the workers were told to end")
        try:
            return self._adopt(launch())
        except OSError as error:
            reason = os.strerror(error.errno or 0)
        count = len(self._workers)
        if not count:
            raise UsageError(f"no worker process can be started ({reason}); raise the limits of ulimit -n and -u")
        self._num_workers = count
        started = f"only {count} worker process{'es' * (count > 1)} can be started"
        self._news.append(Note(f"{started} ({reason}); the run goes on with {'them' if count > 1 else 'it'}"))
        return None

    def _adopt(self, process: Process) -> Worker:
        worker = Worker(process)
        worker.send(self._setup)
        self._workers.append(worker)
        self._poll.register(process.replies, select.POLLIN)
        if self._interrupted:  # while it was being started
            process.handle.kill()
        return worker

    def _drop(self, worker: Worker) -> None:
        self._workers.remove(worker)
        self._poll.unregister(worker.process.replies)
        worker.process.end()

    def _patience(self, most: int | None) -> int | None:
        """Milliseconds until the first image is overdue, no more than `most`; None when none can be."""
        running = [worker.since for worker in self._workers if worker.ready and worker.queue]
        if not self._timeout or not running:
            return most
        overdue = max(0, int((min(running) + self._timeout - monotonic()) * 1000) + 1)
        return overdue if most is None else min(most, overdue)

    def _read(self, worker: Worker) -> Iterator[Reply]:
        piece = os.read(worker.process.replies, PIECE)
        if not piece:
            yield from self._lost(worker)
            return
        for message in worker.inbox.feed(piece):
            if isinstance(message, Reply):
                worker.queue.popleft()
                worker.since = monotonic()
                worker.clear_log()
                yield message
            else:
                self._greet(worker, message)

    def _greet(self, worker: Worker, message: Any) -> None:  # noqa: ANN401 - Ready or Refused
        if isinstance(message, Refused):
            raise UsageError(message.message)
        if isinstance(message, Ready):
            worker.ready, worker.since = True, monotonic()
            self._stillborn = 0
            self._news.append(message)

    def _lost(self, worker: Worker) -> Iterator[Reply]:
        code = worker.process.handle.wait()
        tail = worker.log_tail()
        self._drop(worker)
        if not worker.ready:
            self._waiting.extendleft(reversed(worker.queue))
            self._stillborn += 1
            if self._stillborn < _MAX_FAILED_STARTS:
                return
            raise WorkerLostError(
                f"a worker process ended ({_ending(code)}) before it was ready: {tail or 'no message'}"
            )
        if worker.queue:
            task = worker.queue.popleft()
            self._waiting.extendleft(reversed(worker.queue))
            message = f"the worker process ended ({_ending(code)}) while it had this image; it was not tried again"
            yield Failed(task.job.index, "crash", message, tail)

    def _overdue(self) -> Iterator[Reply]:
        if not self._timeout:
            return
        limit = monotonic() - self._timeout
        for worker in [worker for worker in self._workers if worker.ready and worker.queue and worker.since < limit]:
            task = worker.queue.popleft()
            self._waiting.extendleft(reversed(worker.queue))
            worker.queue.clear()
            self._drop(worker)
            message = f"it took more than {self._timeout:g} s; raise --timeout or leave it out"
            yield Failed(task.job.index, "timeout", message)


def _ending(code: int) -> str:
    if code >= 0:
        return f"exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    return f"{name}, perhaps memory ran out" if name == "SIGKILL" else name
