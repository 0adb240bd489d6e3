"""The state of a run so far, shared by its parts and reported to its caller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Protocol

from ffseg.batch.plan.jobs import Plan
from ffseg.batch.plan.sources import Job
from ffseg.batch.values import Record
from ffseg.batch.workers.messages import Done, Reply


class Stop(Protocol):
    """Tells a run to end early."""

    @property
    def signal(self) -> int:
        """0, or the signal that asks for the end."""

    @property
    def descriptor(self) -> int:
        """Becomes readable when `signal` is set."""


class Observer(Protocol):
    """Hears of the progress of a run."""

    def finished(self, job: Job, status: str, note: str) -> None:
        """An image ended as ``ok``, ``unchanged`` (done before) or ``failed``; what there is to tell of it."""

    def note(self, text: str) -> None:
        """Something the user should know that belongs to no image."""


@dataclass(slots=True)
class Summary:
    """How a run ended."""

    total: int
    """Images of this run; the next three are what became of them."""
    done: int = 0
    unchanged: int = 0
    failed: int = 0
    stale: int = 0
    """Images of earlier runs, and outputs, that no longer are what their record says: named in ``run.json``."""
    removed: int = 0
    """Outputs removed because they belonged to no image any longer."""
    seconds: float = 0.0
    signal: int = 0
    """That ended it early; 0 for none."""
    problems: list[str] = field(default_factory=list)
    drive: dict[str, Any] = field(default_factory=dict)
    """Figures of the map of all frames, where one is made."""

    def counts(self) -> dict[str, int]:
        """Numbers of images by what became of them."""
        return {name: getattr(self, name) for name in ("total", "done", "unchanged", "failed", "stale")}


class Ledger:
    """The state of a run between its parts.

    Attributes
    ----------
    finished : bytearray
        1 for each image of the plan that is finished.
    versions : mapping of str to str
        Of what the workers have loaded.
    """

    def __init__(self, plan: Plan, observer: Observer) -> None:
        self.summary = Summary(len(plan.jobs))
        self.finished = bytearray(len(plan.jobs))
        self.started = datetime.now(UTC)
        self.versions: Mapping[str, str] = {}
        self.note = observer.note
        self._plan, self._observer = plan, observer

    def count(self, reply: Reply, record: Record) -> None:
        """Take into account that an image is finished."""
        self.finished[reply.index] = 1
        unchanged = record.status == "ok" and isinstance(reply, Done) and reply.unchanged
        status = "unchanged" if unchanged else record.status
        name = "done" if status == "ok" else status
        setattr(self.summary, name, getattr(self.summary, name) + 1)
        note = reply.note if isinstance(reply, Done) else ""
        self._observer.finished(self._plan.jobs[reply.index], status, record.row["error"] or note)

    def problem(self, text: str) -> None:
        """Take into account, once, what went wrong beside images."""
        if text not in self.summary.problems:
            self.summary.problems.append(text)
            self.note(text)
