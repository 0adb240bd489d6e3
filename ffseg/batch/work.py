"""The work of a run: an executor is given the images of a plan, and what comes of them is written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile

from ffseg.batch.executors.base import Assignment, Do, Executor, Options, served
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.keeper import Keeper
from ffseg.batch.record.ledger import Ledger, Stop
from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Failed, Note, Ready, Reply, Setup, Task
from ffseg.errors import UsageError
from ffseg.plugins import find

_TOGETHER_MS = 20
"""Milliseconds a reply waits for those of other workers."""


@dataclass(frozen=True, slots=True)
class Work:
    """Does the images of a keeper's plan, until the end is asked for."""

    keeper: Keeper
    ledger: Ledger
    setup: Setup
    options: Options
    stop: Stop

    def do(self, started: Sequence[Process]) -> None:
        """Do them, with worker processes that have been started already."""
        jobs, name = self.keeper.plan.jobs, self.options.executor
        self._take([_untried(job) for job in jobs if job.source.problem])
        tasks = (self._task(job) for job in jobs if not job.source.problem)
        chosen = find("executors", name)
        if isinstance(chosen, type) and issubclass(chosen, Executor):
            where = {"state": self.keeper.state, "settings": self.keeper.settings}
            executor = chosen(Assignment(self.setup, self.options, started, self.stop.descriptor, len(jobs), **where))
            try:
                self._feed(executor, tasks)
            finally:
                executor.close()
        else:
            self._map(name, chosen, tasks)
        self.ledger.summary.signal = self.stop.signal

    def _feed(self, executor: Executor, tasks: Iterator[Task]) -> None:
        """Write one reply of each worker together: the disk is waited for less. What has come is written in any case."""
        held: list[Reply] = []
        came = 0
        try:
            for event in served(executor, tasks, lambda: not self.stop.signal, lambda: _TOGETHER_MS if held else None):
                if event is None:
                    if len(held) >= self.options.num_workers or not came:
                        together = held.copy()
                        held.clear()
                        self._take(together)
                    came = 0
                elif isinstance(event, Note):
                    self.ledger.note(event.text)
                elif isinstance(event, Ready):
                    self.ledger.versions = event.versions
                else:
                    held.append(event)
                    came += 1
        finally:
            self._take(held)

    def _map(self, name: str, executor: Callable[[Do, Iterator[Task]], Iterable[Reply]], tasks: Iterator[Task]) -> None:
        """Let a function do the tasks, in any order; it may draw them from another thread."""
        do = Do(self.setup)
        self.ledger.versions = do.bench.versions()
        for reply in executor(do, takewhile(lambda _: not self.stop.signal, tasks)):
            if not isinstance(reply, Reply):
                raise UsageError(f"--executor: {name} gave {type(reply).__name__}, not what do(task) returned")
            if not self.ledger.finished[reply.index]:
                self._take([reply])
            if self.stop.signal:
                return
        lost = f"the executor {name} gave no reply for it"
        left = (job.index for job in self.keeper.plan.jobs if not (self.stop.signal or self.ledger.finished[job.index]))
        self._take([Failed(index, "crash", lost) for index in left])

    def _task(self, job: Job) -> Task:
        record = None if self.options.overwrite else self.keeper.journal.get(job.index)
        fits = record is not None and record.fits(self.keeper.settings)
        return Task(job, self.keeper.plan.out, self.keeper.plan.outputs(job), record if fits else None)

    def _take(self, replies: Sequence[Reply]) -> None:
        """Write what replies bring and remember it: never more images at once than there are workers."""
        together = self.options.num_workers
        for first in range(0, len(replies), together):
            for completed in self.keeper.complete(replies[first : first + together]):
                self.ledger.count(completed)


def _untried(job: Job) -> Failed:
    """The reply for an image that cannot even be tried."""
    reason, message = job.source.problem.split(": ", 1)
    return Failed(job.index, reason, message)
