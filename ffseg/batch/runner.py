"""A run over many images: each result is whole or absent, made once, and a failure affects no other image."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import takewhile
from time import perf_counter
from typing import Any

from ffseg.batch.ending import Ending
from ffseg.batch.executors.base import Assignment, Do, Executor, Options, serve
from ffseg.batch.executors.chunks import left_over, remove_chunks
from ffseg.batch.outputs.table import RUN
from ffseg.batch.plan.jobs import Plan, prepare_output, sweep
from ffseg.batch.plan.sources import Job
from ffseg.batch.record.foreign import UNFINISHED, joint_files, refuse_foreign
from ffseg.batch.record.header import refuse_mixing, run_header
from ffseg.batch.record.journal import state_folder
from ffseg.batch.record.keeper import Keeper, open_keeper
from ffseg.batch.record.ledger import Ledger, Observer, Stop, Summary
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.record.ordered import moved_records
from ffseg.batch.record.survey import without_old_truth
from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Done, Failed, Note, Ready, Reply, Setup, Task
from ffseg.errors import UsageError
from ffseg.io.files import printable, remove_files, write_bytes_atomic
from ffseg.plugins import find

_TOGETHER_MS = 20
"""Milliseconds a reply waits for those of other workers."""


class Run:
    """One run into one output folder, a context manager that holds the folder's lock from `execute` to its end."""

    def __init__(self, plan: Plan, setup: Setup, options: Options, stop: Stop, observer: Observer) -> None:
        self._plan, self._setup, self._options, self._stop = plan, setup, options, stop
        self._ledger = Ledger(plan, observer)
        self._keeper: Keeper
        self._held = contextlib.ExitStack()
        self.summary = self._ledger.summary

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    def execute(self, started: Sequence[Process] = ()) -> Summary:
        """Do the plan: refuse what cannot go together, lock, work, write the tables.

        Parameters
        ----------
        started : sequence of Process
            Worker processes that have been started already.

        Raises
        ------
        UsageError
            Before the first image: another run is at work here, an earlier one had other parameters, or files that no
            run has made are in the way.
        OutputError
            Before the first image: the output folder cannot be written.
        """
        plan, setup, options = self._plan, self._setup, self._options
        header, state = run_header(setup), state_folder(plan.out, plan.shard)
        if not options.overwrite:
            refuse_foreign(plan, setup, options)
        begin = perf_counter()
        self._held.enter_context(OutputLock(plan.out, state))
        if not options.overwrite:
            refuse_mixing(plan.out, state, header, pack=plan.products.pack)
        prepare_output(plan, state)
        sweep(plan, state)
        joint = joint_files(plan, setup, options)
        self._keeper = open_keeper(plan, header, setup.params.method, self._ledger.problem, joint)
        self._held.enter_context(contextlib.closing(self._keeper))
        write_bytes_atomic(os.path.join(state, UNFINISHED), b"")
        self._resume()
        self._work(started)
        self.summary.seconds = perf_counter() - begin
        Ending(self._keeper, self._ledger, setup, options, self._stop).write()
        if all(self._ledger.finished) and not self.summary.problems:  # nor was a record that cannot be written
            remove_files([os.path.join(state, UNFINISHED)])
        return self.summary

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of ``timings.csv`` of the images of the plan that are finished, in input order."""
        for job in self._plan.jobs:
            record = self._keeper.journal.get(job.source.name) if self._ledger.finished[job.index] else None
            if record is not None:
                yield {"image": printable(job.source.name), **without_old_truth(record).row}

    def _work(self, started: Sequence[Process]) -> None:
        """Do the images, until the end is asked for."""
        jobs, name = self._plan.jobs, self._options.executor
        self._take([Failed(job.index, *job.source.problem.split(": ", 1)) for job in jobs if job.source.problem])
        tasks = (self._task(job) for job in jobs if not job.source.problem)
        chosen = find("executors", name)
        if isinstance(chosen, type) and issubclass(chosen, Executor):
            where = {"state": self._keeper.state, "settings": self._keeper.settings}
            executor = chosen(
                Assignment(self._setup, self._options, started, self._stop.descriptor, len(jobs), **where)
            )
            try:
                self._feed(executor, tasks)
            finally:
                executor.close()
            self._take([reply for reply in self._left_over() if not self._ledger.finished[reply.index]])
        else:
            self._map(name, chosen, tasks)
        self.summary.signal = self._stop.signal

    def _feed(self, executor: Executor, tasks: Iterator[Task]) -> None:
        """Write one reply of each worker together: the disk is waited for less. What has come is written in any case."""
        held: list[Reply] = []
        arrived = 0
        try:
            for event in serve(executor, tasks, lambda: not self._stop.signal, lambda: _TOGETHER_MS if held else None):
                if event is None:
                    if len(held) >= self._options.num_workers or not arrived:
                        together = held.copy()
                        held.clear()
                        self._take(together)
                    arrived = 0
                elif isinstance(event, Note):
                    self._ledger.note(event.text)
                elif isinstance(event, Ready):
                    self._ledger.versions = event.versions
                else:
                    held.append(event)
                    arrived += 1
        finally:
            self._take(held)

    def _map(self, name: str, executor: Callable[[Do, Iterator[Task]], Iterable[Reply]], tasks: Iterator[Task]) -> None:
        """Let a function do the tasks, in any order; it may draw them from another thread."""
        do = Do(self._setup)
        self._ledger.versions = do.bench.versions()
        replies = executor(do, takewhile(lambda _: not self._stop.signal, tasks))
        if not isinstance(replies, Iterable):
            raise UsageError(
                f"--executor: {name} gave {type(replies).__name__}, not what do(task) returned for each task"
            )
        for reply in replies:
            if not isinstance(reply, Reply):
                raise UsageError(f"--executor: {name} gave {type(reply).__name__}, not what do(task) returned")
            if not self._ledger.finished[reply.index]:
                self._take([reply])
            if self._stop.signal:
                return
        lost = f"the executor {name} gave no reply for it"
        left = (job.index for job in self._plan.jobs if not (self._stop.signal or self._ledger.finished[job.index]))
        self._take([Failed(index, "crash", lost) for index in left])

    def _task(self, job: Job) -> Task:
        record = None if self._options.overwrite else self._keeper.journal.get(job.source.name)
        outputs = self._plan.outputs(job)
        fits = record is not None and record.fits(self._keeper.settings)
        named = record is not None and outputs[0] in record.outputs  # else an earlier run called its outputs otherwise
        return Task(job, self._plan.out, outputs, record if fits and named else None)

    def _take(self, replies: Sequence[Reply]) -> None:
        """Write what replies bring and remember it: never more images at once than there are workers."""
        together = self._options.num_workers
        for first in range(0, len(replies), together):
            part = replies[first : first + together]
            for reply, record in zip(part, self._keeper.complete(part), strict=True):
                self._ledger.count(reply, record)

    def _resume(self) -> None:
        """Take over what runs left that did not live to write it down."""
        keeper, plan = self._keeper, self._plan
        for reply in self._left_over():
            keeper.adopt(reply)
        remove_chunks(keeper.state)
        if plan.shard:  # until it has finished, it has not
            if plan.tars:
                for moved in moved_records(plan.out, keeper.journal.get):
                    keeper.journal.add(moved)
            remove_files([os.path.join(keeper.state, RUN)])

    def _left_over(self) -> Iterator[Done]:
        """What workers have done and written down; what failed there may have been cut off."""
        index = {job.source.name: job.index for job in self._plan.jobs}
        found = left_over(self._keeper.state, self._keeper.settings)
        return (replace(one, index=index[name]) for name, one in found if name in index and isinstance(one, Done))
