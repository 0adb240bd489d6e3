"""Worker processes that a machine of a cluster keeps between chunks: starting one takes as long as forty images."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field

from ffseg.batch.executors.choice import Start
from ffseg.batch.executors.processes import AHEAD, Processes
from ffseg.batch.workers.messages import Setup


@dataclass(eq=False, slots=True)
class Held:
    """A worker process between chunks, and the versions it told when it began."""

    executor: Processes
    versions: dict[str, str] = field(default_factory=dict)


_idle: dict[str, list[Held]] = {}
"""Worker processes between chunks, by what they are set up for."""
_busy: set[Held] = set()
"""Worker processes that work on a chunk."""
_lock = threading.Lock()


def lend(key: str, start: Start) -> None:
    """Let workers of this process have the worker processes that were started with the command."""
    count = start.amount.num_workers
    with _lock:
        held = _idle.setdefault(key, [])
        for process in start.started[:count]:
            held.append(Held(Processes(start.setup, 1, start.amount.timeout, [process])))


@contextlib.contextmanager
def worker_process(key: str, setup: Setup, timeout: float) -> Iterator[Held]:
    """One worker process of this machine, kept for the next chunk unless something went wrong."""
    with _lock:
        idle = _idle.setdefault(key, [])
        held = idle.pop() if idle else Held(Processes(setup, 1, timeout))
        _busy.add(held)
    forget(key)
    try:
        yield held
    except BaseException:
        held.executor.close()
        raise
    finally:
        _busy.discard(held)
    if held.executor.room() < AHEAD:  # it has something to do still: the chunk is no longer wanted
        held.executor.close()
        return
    with _lock:
        _idle.setdefault(key, []).append(held)


def interrupt() -> None:
    """Kill the processes that work on a chunk."""
    for held in list(_busy):
        held.executor.interrupt()


def forget(key: str) -> None:
    """End the processes of other setups: those of a run that is over."""
    with _lock:
        others = [held for other in [other for other in _idle if other != key] for held in _idle.pop(other)]
    for held in others:
        held.executor.close()
