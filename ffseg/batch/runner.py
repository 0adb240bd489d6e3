"""A run over many images: each is whole or absent, done once, and its failure costs nobody else anything."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from time import perf_counter
from typing import Any

from ffseg.batch.ending import Ending
from ffseg.batch.executors.base import Options
from ffseg.batch.executors.chunks import left_over, numbered
from ffseg.batch.plan.jobs import Plan, prepare_output, refuse_foreign, sweep
from ffseg.batch.record.finish import find_moved
from ffseg.batch.record.header import refuse_mixing, run_header
from ffseg.batch.record.journal import state_folder
from ffseg.batch.record.keeper import Keeper, kept
from ffseg.batch.record.ledger import Ledger, Observer, Stop, Summary
from ffseg.batch.record.lock import OutputLock
from ffseg.batch.record.tables import RUN
from ffseg.batch.work import Work
from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Setup
from ffseg.io.files import printable


class Run:
    """One run into one output folder, a context manager that holds the folder's lock from `execute` to its end."""

    def __init__(self, plan: Plan, setup: Setup, options: Options, stop: Stop, observer: Observer) -> None:
        self._plan, self._setup, self._options, self._stop = plan, setup, options, stop
        self._ledger = Ledger(plan, observer, noted=setup.views is None)
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
            refuse_foreign(plan)
        begin = perf_counter()
        self._held.enter_context(OutputLock(plan.out, state))
        if not options.overwrite:
            refuse_mixing(plan.out, state, header, pack=plan.products.pack)
        prepare_output(plan, state)
        sweep(plan, state)
        asked = {"camera": setup.views is not None, "parquet": options.parquet}
        self._keeper = kept(plan, header, setup.params.method, self._ledger.problem, **asked)
        self._held.enter_context(contextlib.closing(self._keeper))
        _resume(self._keeper)
        Work(self._keeper, self._ledger, setup, options, self._stop).do(started)
        self.summary.seconds = perf_counter() - begin
        Ending(self._keeper, self._ledger, setup, options, self._stop).write()
        return self.summary

    def rows(self) -> Iterator[dict[str, Any]]:
        """Rows of ``timings.csv`` of the images of the plan that are finished, in input order."""
        for job in self._plan.jobs:
            record = self._keeper.journal.get(job.index) if self._ledger.finished[job.index] else None
            if record is not None:
                yield {"image": printable(job.source.name), **record.row}


def _resume(keeper: Keeper) -> None:
    """Take over what runs left that did not live to write it down."""
    plan, index = keeper.plan, {job.source.name: job.index for job in keeper.plan.jobs}
    for name, reply in left_over(keeper.state, keeper.settings):
        if name in index:
            keeper.adopt(numbered(reply, index[name]))
    if plan.shard:  # until it has finished, it has not
        if plan.tars:
            find_moved(plan.out, keeper.journal, plan)
        with contextlib.suppress(OSError):
            os.unlink(os.path.join(keeper.state, RUN))
