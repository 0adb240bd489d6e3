"""Executors by name: one row each, that loads nothing until it is chosen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ffseg.batch.executors.base import Executor
from ffseg.batch.outputs.table import resolve
from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Setup
from ffseg.errors import UsageError


class Amount(Protocol):
    """How much an executor may use."""

    @property
    def num_workers(self) -> int:
        """Images worked on at once."""

    @property
    def timeout(self) -> float:
        """Seconds an image may take; 0 for no limit."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Which executor, and where it is found.

    Attributes
    ----------
    name : str
        A name of `EXECUTORS`.
    address : str
        Of a scheduler that is running already; empty to start what is needed.
    chunk : int
        Images given to a worker at once, where that matters.
    """

    name: str = "processes"
    address: str = ""
    chunk: int = 500


@dataclass(frozen=True, slots=True)
class Start:
    """What an executor is made from.

    Attributes
    ----------
    choice : Choice
    setup : Setup
    amount : Amount
    started : sequence of Process
        Worker processes that are there already; whoever does not use them leaves them to the command.
    stop : int
        A file descriptor that ends all waiting when it becomes readable; -1 for none.
    num_tasks : int
        How many there will be.
    state : str
        Folder of the run's state, for executors that leave something there.
    settings : str
        Digest of the parameters.
    """

    choice: Choice
    setup: Setup
    amount: Amount
    started: Sequence[Process] = ()
    stop: int = -1
    num_tasks: int = 1
    state: str = ""
    settings: str = ""


EXECUTORS = {
    "processes": "ffseg.batch.executors.choice:processes",
    "inprocess": "ffseg.batch.executors.choice:inprocess",
    "dask": "ffseg.batch.executors.dask:dask",
}
"""``module:function`` of each executor, called with a `Start`. A new one is a row here and a class with four verbs."""


def processes(start: Start) -> Executor:
    """Processes of this machine."""
    from ffseg.batch.executors.processes import Processes

    return Processes(start.setup, start.amount.num_workers, start.amount.timeout, start.started, start.stop)


def inprocess(start: Start) -> Executor:
    """The process of the run itself."""
    from ffseg.batch.executors.inprocess import InProcess

    return InProcess(start.setup)


def start(order: Start) -> Executor:
    """Start the executor that was chosen.

    Raises
    ------
    UsageError
        For a name that is none of `EXECUTORS`.
    """
    name = order.choice.name
    if name not in EXECUTORS:
        raise UsageError(f"--executor: there is no '{name}'; choose from {', '.join(EXECUTORS)}")
    make: Callable[[Start], Executor] = resolve(EXECUTORS[name])
    return make(order)
