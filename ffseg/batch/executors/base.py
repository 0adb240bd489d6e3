"""What a run asks of whoever works on its images."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from ffseg.batch.workers.messages import Event, Task


class Executor(Protocol):
    """Takes tasks, gives one reply for each, in any order, and does nothing else.

    Notes
    -----
    A run puts tasks while there is room, then asks for replies, until every task has its reply. Beside replies an
    executor may give `Ready` (the versions its workers have) and `Note` (something to tell the user).
    """

    def room(self) -> int:
        """How many more tasks can be taken before replies have to be waited for."""

    def put(self, task: Task) -> None:
        """Take a task."""

    def replies(self, most: int | None = None) -> Iterator[Event]:
        """Wait until something happens and give what came of it, often one reply, sometimes nothing.

        Parameters
        ----------
        most : int, optional
            Milliseconds after which nothing has happened.

        Raises
        ------
        UsageError
            If the setup does not work.
        """

    def close(self) -> None:
        """End all work at once; replies that have not been given are lost."""
