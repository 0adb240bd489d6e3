"""The interface of executors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from ffseg.batch.workers.launch import Process
from ffseg.batch.workers.messages import Event, Reply, Setup, Task
from ffseg.errors import ParameterError, UsageError


@dataclass(frozen=True, slots=True)
class Options:
    """How a run goes about its plan."""

    num_workers: int = 1
    """Images worked on at once."""
    timeout: float = 0.0
    """Seconds an image may take, 0 for no limit."""
    overwrite: bool = False
    """Do everything again, whatever an earlier run left."""
    report: bool = False
    """Write the report page at the end."""
    parquet: bool = False
    """Write ``timings.parquet``, too."""
    executor: str = "processes"
    """Who works on the images, as ``--executor`` takes it (`ffseg.plugins.EXECUTORS`)."""
    scheduler: str = ""
    """Address of one that is running already; empty to start what is needed."""
    chunk: int = 500
    """Images given to a worker at once, where that matters."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """What an executor of ffseg's own begins with."""

    setup: Setup
    options: Options = Options()
    started: Sequence[Process] = ()
    """Worker processes that are there already; whoever does not use them leaves them to the command."""
    stop: int = -1
    """A file descriptor that ends all waiting when it becomes readable; -1 for none."""
    num_tasks: int = 1
    """How many there will be."""
    state: str = ""
    """Folder of the run's state, for executors that leave something there."""
    settings: str = ""
    """Digest of the parameters."""


class Executor(ABC):
    """Takes tasks, gives one reply for each, in any order, and does nothing else.

    Notes
    -----
    A run puts tasks while there is room, then asks for replies, until every task has its reply. Beside replies an
    executor may give `Ready` (the versions its workers have) and `Note` (something to tell the user).
    """

    @abstractmethod
    def __init__(self, start: Assignment) -> None:
        """Begin."""

    @abstractmethod
    def room(self) -> int:
        """How many more tasks can be taken before replies have to be waited for."""

    @abstractmethod
    def put(self, task: Task) -> None:
        """Take a task."""

    @abstractmethod
    def replies(self, most: int | None = None) -> Iterator[Event]:
        """Wait until something happens and give what came of it, often one reply, sometimes nothing.

        Parameters
        ----------
        most : int, optional
            Milliseconds after which nothing has happened.
        """

    @abstractmethod
    def close(self) -> None:
        """End all work at once; replies that have not been given are lost."""


def serve(
    executor: Executor, tasks: Iterator[Task], wanted: Callable[[], bool], patience: Callable[[], int | None]
) -> Iterator[Event | None]:
    """Give an executor tasks while it has room, until all replies are in or they are no longer wanted.

    Yields what it gives, and None each time it has been waited for, with so much patience in milliseconds.
    """
    waiting = 0
    while wanted():
        while executor.room() > 0 and (task := next(tasks, None)) is not None:
            executor.put(task)
            waiting += 1
        if not waiting:
            return
        for event in executor.replies(patience()):
            waiting -= isinstance(event, Reply)
            yield event
        yield None


class Do:
    """Does a task wherever it is called: what executors that are functions get; it may be sent to other processes.

    Parameters
    ----------
    setup : Setup
        Its limits of time and memory are not kept.
    """

    def __init__(self, setup: Setup) -> None:
        from ffseg.batch.workers.work import Workbench  # loads NumPy and OpenCV, which the run itself can do without

        self._setup = setup
        try:
            self.bench = Workbench(setup)
        except ParameterError as error:
            raise UsageError(str(error)) from error

    def __call__(self, task: Task) -> Reply:
        """Segment the task's image and encode its outputs; whatever goes wrong with it is in the reply."""
        return self.bench.reply(task)

    def __reduce__(self) -> tuple[type[Do], tuple[Setup]]:
        """Travel without what is loaded."""
        return Do, (self._setup,)
