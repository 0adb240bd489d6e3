"""Worker processes kept alive between the chunks of a cluster machine: starting one takes as long as forty images."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from threading import RLock, Timer

from ffseg.batch.executors.base import Assignment, Options
from ffseg.batch.executors.processes import TASKS_AHEAD, Processes
from ffseg.batch.workers.messages import Setup

IDLE_S = 60.0
"""Seconds that a process is kept without a chunk: chunks of a run follow each other at once, and a run that was killed
cannot say that no more will come."""


@dataclass(eq=False, slots=True)
class HeldProcess:
    """A worker process, the versions it told when it began, and what ends it when it is idle for long."""

    key: str
    executor: Processes
    versions: dict[str, str] = field(default_factory=dict)
    end: Timer = field(init=False)


_idle: list[HeldProcess] = []
"""Worker processes between chunks."""
_busy: set[HeldProcess] = set()
"""Worker processes that work on a chunk."""
_changing = RLock()
"""Held while the idle ones change."""


def lend(key: str, start: Assignment) -> None:
    """Let workers of this process have the worker processes that were started with the command."""
    alone = replace(start.options, num_workers=1)
    for process in start.started[: start.options.num_workers]:
        _keep(HeldProcess(key, Processes(Assignment(start.setup, alone, [process]))))


@contextlib.contextmanager
def worker_process(key: str, setup: Setup, timeout: float, going: str) -> Iterator[HeldProcess]:
    """One worker process of this machine, kept for the next chunk unless something went wrong.

    Parameters
    ----------
    key : str
        Digest of what the process is for.
    timeout : float
        Seconds an image may take.
    going : str
        File that is there as long as the run may have more chunks.
    """
    held = _take(lambda one: one.key == key) or HeldProcess(key, Processes(Assignment(setup, Options(1, timeout))))
    _busy.add(held)
    try:
        yield held
    except BaseException:
        held.executor.close()
        raise
    finally:
        _busy.discard(held)
    with _changing:  # whoever ends the idle ones of a run that is over sees this one, or this one sees that it is over
        wanted = held.executor.room() == TASKS_AHEAD and os.path.exists(going)  # else it may have something to do still
        if wanted:
            _keep(held)
    if not wanted:
        held.executor.close()


def _take(meant: Callable[[HeldProcess], bool]) -> HeldProcess | None:
    """Take a process that is meant out of the idle ones; None where there is none."""
    with _changing:
        found = next(filter(meant, _idle), None)
        if found is not None:
            found.end.cancel()
            _idle.remove(found)
    return found


def _keep(held: HeldProcess) -> None:
    """Let a process wait for a chunk, but not for ever."""
    held.end = Timer(IDLE_S, _end, (lambda one: one is held,))
    held.end.daemon = True
    with _changing:
        _idle.append(held)
        held.end.start()


def _end(meant: Callable[[HeldProcess], bool]) -> None:
    while (held := _take(meant)) is not None:
        held.executor.close()


def interrupt() -> None:
    """Kill the processes that work on a chunk."""
    for held in list(_busy):
        held.executor.interrupt()


def end_idle(key: str = "") -> None:
    """End the idle processes of a setup, whose run is over, or all of them."""
    _end(lambda held: key in ("", held.key))
