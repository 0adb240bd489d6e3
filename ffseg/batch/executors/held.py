"""Worker processes that a machine of a cluster keeps between chunks: starting one takes as long as forty images."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from time import monotonic

from ffseg.batch.executors.base import Assignment, Options
from ffseg.batch.executors.processes import AHEAD, Processes
from ffseg.batch.workers.messages import Setup

IDLE_S = 60.0
"""Seconds that a process is kept without a chunk: chunks of a run follow each other at once, and a run that was killed
cannot say that no more will come."""


@dataclass(eq=False, slots=True)
class Held:
    """A worker process, the versions it told when it began, and since when it is idle (`monotonic`)."""

    key: str
    executor: Processes
    versions: dict[str, str] = field(default_factory=dict)
    since: float = 0.0


_idle: list[Held] = []
"""Worker processes between chunks."""
_busy: set[Held] = set()
"""Worker processes that work on a chunk."""
_changed = threading.Condition()
"""Held to look at the idle ones; told when they are ended early."""
_watched: list[threading.Thread] = []
"""The thread that ends what is idle for long, while there is any."""


def lend(key: str, start: Assignment) -> None:
    """Let workers of this process have the worker processes that were started with the command."""
    alone = replace(start.options, num_workers=1)
    for process in start.started[: start.options.num_workers]:
        _keep(Held(key, Processes(Assignment(start.setup, alone, [process]))))


@contextlib.contextmanager
def worker_process(key: str, setup: Setup, timeout: float, going: str) -> Iterator[Held]:
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
    with _changed:
        held = next((one for one in _idle if one.key == key), None)
        if held is not None:
            _idle.remove(held)
        else:
            held = Held(key, Processes(Assignment(setup, Options(1, timeout))))
        _busy.add(held)
    end_others(key)
    try:
        yield held
    except BaseException:
        held.executor.close()
        raise
    finally:
        _busy.discard(held)
    with _changed:  # whoever ends the idle ones of a run that is over sees this one, or this one sees that it is over
        wanted = held.executor.room() == AHEAD and os.path.exists(going)  # else it may have something to do still
        if wanted:
            _keep(held)
    if not wanted:
        held.executor.close()


def _keep(held: Held) -> None:
    """Let a process wait for a chunk, watched."""
    with _changed:
        held.since = monotonic()
        _idle.append(held)
        if not _watched:
            _watched.append(threading.Thread(target=_watch, daemon=True))
            _watched[0].start()


def _watch() -> None:
    """End processes that are idle for long, until there is none left."""
    while True:
        with _changed:
            old = _removed(lambda held: held.since <= monotonic() - IDLE_S)
            oldest = min((held.since for held in _idle), default=None)
            if oldest is None:
                _watched.clear()
            elif not old:
                _changed.wait(oldest + IDLE_S - monotonic())
        _end(old)
        if oldest is None:
            return


def interrupt() -> None:
    """Kill the processes that work on a chunk."""
    for held in list(_busy):
        held.executor.interrupt()


def end_idle(key: str = "") -> None:
    """End the idle processes of a setup, whose run is over, or all of them."""
    with _changed:
        idle = _removed(lambda held: key in ("", held.key))
        _changed.notify_all()
    _end(idle)


def end_others(key: str) -> None:
    """End the idle processes of other setups."""
    with _changed:
        idle = _removed(lambda held: held.key != key)
    _end(idle)


def _removed(chosen: Callable[[Held], bool]) -> list[Held]:
    """Take the chosen ones out of the idle ones."""
    found = list(filter(chosen, _idle))
    _idle[:] = [held for held in _idle if held not in found]
    return found


def _end(idle: Iterable[Held]) -> None:
    for held in idle:
        held.executor.close()
