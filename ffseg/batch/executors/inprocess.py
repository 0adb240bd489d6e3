"""Work on images in this process: for debuggers and tests. A crash ends everything, and nothing is interrupted."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from ffseg.batch.workers.messages import Event, Ready, Setup, Task
from ffseg.errors import ParameterError, UsageError


class InProcess:
    """An executor without workers: an image is done when its reply is asked for.

    Parameters
    ----------
    setup : Setup
        Its limits of time and memory are not kept.
    """

    def __init__(self, setup: Setup) -> None:
        from ffseg.batch.workers.work import Workbench

        try:
            self._bench = Workbench(setup)
        except ParameterError as error:
            raise UsageError(str(error)) from error
        self._waiting: deque[Task] = deque()
        self._greeted = False

    def room(self) -> int:
        """As `Executor.room`."""
        return 1 - len(self._waiting)

    def put(self, task: Task) -> None:
        """As `Executor.put`."""
        self._waiting.append(task)

    def replies(self, most: int | None = None) -> Iterator[Event]:  # noqa: ARG002 - it never waits
        """As `Executor.replies`."""
        if not self._greeted:
            self._greeted = True
            yield Ready(self._bench.versions())
        while self._waiting:
            yield self._bench.reply(self._waiting.popleft())

    def close(self) -> None:
        """As `Executor.close`."""
        self._waiting.clear()
