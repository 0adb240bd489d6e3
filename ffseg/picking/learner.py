"""Background work of `ffseg pick`: ``ffseg learn`` and ``ffseg run`` as processes of their own, at low priority."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass

from ffseg.errors import FfsegError, ImageReadError, ParameterError
from ffseg.evidence.source import ready
from ffseg.io.files import read_bytes, write_bytes_atomic
from ffseg.io.tables import counted
from ffseg.picking.project import LEARNED, MAX_BYTES, MODEL, RUN, Project

MIN_MASKS = 2
"""A model is learned from so many, which can be measured, or from a single one that shows many things: by it drawn nuclei and
leaves have an IoU of .94 and .96. By one mask of one thing roads have .63, without a model .70."""


class Background:
    """One command of ffseg at a time; a newer one ends the one before it.

    Parameters
    ----------
    done : callable
        Called with the exit code, stdout and stderr, from a thread, of commands that were not ended.
    """

    def __init__(self, done: Callable[[int, str, str], None]) -> None:
        self._done = done
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether a command is at work."""
        return self._process is not None

    def start(self, arguments: Sequence[str]) -> None:
        """Start ``ffseg ARGUMENTS``, with what the processor has left."""
        with self._lock:
            self._end()
            self._process = subprocess.Popen(  # noqa: S603 - this program itself
                [sys.executable, "-m", "ffseg", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
            )
            os.setpriority(os.PRIO_PROCESS, self._process.pid, 10)
            threading.Thread(target=self._wait, args=(self._process,), daemon=True).start()

    def _wait(self, process: subprocess.Popen[str]) -> None:
        out, err = process.communicate()
        with self._lock:
            current = self._process is process
            if current:
                self._process = None
        if current:
            self._done(process.returncode, out, err)

    def stop(self) -> None:
        """End the command that is at work."""
        with self._lock:
            self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None and process.poll() is None:
            process.terminate()


@dataclass(frozen=True, slots=True)
class Learned:
    """What ``ffseg learn --json`` has found.

    Attributes
    ----------
    line : str
        To be shown.
    order : list of str
        Images, the least sure first.
    of_use, measured : bool
        Of the model; whether it is of use is taken for granted before it is measured.
    startless : bool
        Whether it was kept without starts, as those that it found mostly lay elsewhere.
    """

    line: str
    order: list[str]
    of_use: bool = True
    measured: bool = False
    startless: bool = False


def learn_summary(document: str) -> Learned:
    """What a document of ``ffseg learn --json`` says."""
    found = json.loads(document)
    iou, without, order = found["iou"], found["without"], found.get("order") or []
    if iou is None or without is None:
        many = found["masks"] >= MIN_MASKS
        measured = "now measured on each left out" if many else "how well it does shows with the next"
        return Learned(f"learned from {counted(found['masks'], 'mask')}, {measured}", order)
    startless = found.get("met") is not None and not found["searched"]
    where = "from a click in each" if startless else "on the rest"
    line = f"{found['masks']} masks: {_short(iou)} expected {where}"
    line += f"; {_gain(found['curve'])}" if found["more"] else "; more masks will hardly raise it"
    # what finds starts spares a click in each image, and a run that begins in the middle; else all depends on what it adds
    of_use = found["helps"] is True if startless else iou >= without
    return Learned(line, order, of_use, measured=True, startless=startless)


def _gain(curve: Sequence[Sequence[float]]) -> str:
    rise = (curve[-1][1] - curve[-2][1]) / max(1, curve[-1][0] - curve[-2][0]) if len(curve) > 1 else 0.0
    return f"one more may raise it by about {_short(rise)}" if rise >= 0.005 else "more masks may still raise it"


def _short(value: float) -> str:
    return f"{value:.2f}".removeprefix("0") if value < 1 else "1.00"


def last_line(text: str) -> str:
    """What a command said last."""
    lines = [line for line in text.strip().splitlines() if line.strip()]
    return lines[-1].removeprefix("ffseg: error: ") if lines else ""


class Work:
    """What runs behind one class: learning after each mask, and the run of the folder.

    A model is used as soon as it is grown, and measured on images left out afterwards; one that is found worse than
    none is taken away again. Where the last was, or found no starts, the next is used when it is measured.

    Parameters
    ----------
    project : Project
    forget : callable
        Called when regions are to be found anew: the model or the run is another one.
    changing : context manager
        Held while files are written that follow from the steps.

    Attributes
    ----------
    line, ran : str
        What came of learning and of the run, to be shown.
    order : list of str
        Images, those the model is least sure of first.
    generation : int
        Counts the models and runs.
    """

    def __init__(self, project: Project, forget: Callable[[], None], changing: AbstractContextManager[object]) -> None:
        self.project = project
        self.line, self.ran, self.order, self.generation = "", "", list[str](), 0
        self._forget, self._changing, self._spared, self._measuring = forget, changing, False, False
        self._of: list[object] = []  # what is being learned from
        self._trusted = True  # models before they are measured
        self._learning, self._running = Background(self._learned), Background(self._ran)

    @property
    def runs(self) -> bool:
        """Whether the folder is being done."""
        return self._running.running

    def learn(self, *, again: bool = False) -> None:
        """Learn from the masks there are; a newer mask ends what is at work, but of two in a row the second is spared."""
        count = self.project.count("accepted")
        if count < MIN_MASKS and not self.project.shows_many():
            self.line = f"{MIN_MASKS - count} more accepted and a model is learned from them"
            self._learning.stop()
            if self.project.model:
                self._use(learned=False)
            return
        if self._learning.running and self._spared:
            return
        if not again and self._known():
            return
        self._spared = self._learning.running and not self._measuring
        self.line = f"learning from {counted(count, 'mask')}"
        self._of = self.project.learned_from()
        self._start(measuring=False)

    def _known(self) -> bool:
        """Take up what an earlier session has learned from these masks; whether there is any."""
        self._of = self.project.learned_from()
        self._drop_unusable()
        try:
            kept = json.loads(read_bytes(self.project.path(LEARNED), MAX_BYTES))
            if kept["of"] != self._of:
                return False
            figures = str(kept["figures"])
            learned = self._say(figures)
        except (ImageReadError, ValueError, KeyError, TypeError):  # none, or not to be read: learned anew
            return False
        if learned.of_use and not self.project.model:
            return False
        if not learned.measured:
            self._measure()
        return True

    def _drop_unusable(self) -> None:
        """Take away a model that cannot be asked: of another version of ffseg, or damaged."""
        try:
            if self.project.model:
                ready(self.project.model)
        except ParameterError:
            self._use(learned=False)

    def _say(self, figures: str) -> Learned:
        found = learn_summary(figures)
        self.line, self.order = found.line + ("" if found.of_use else "; it is not used"), found.order
        self._trusted = found.of_use and not found.startless if found.measured else self._trusted
        return found

    def _start(self, *, measuring: bool) -> None:
        self._measuring = measuring
        arguments = self.project.learning(self.project.path("learning.ffmodel"))
        self._learning.start([*arguments, *([] if measuring else ["--quick"])])

    def _measure(self) -> None:
        """Learn again, and measure; of a single mask nothing can be left out."""
        if self.project.count("accepted") >= MIN_MASKS:
            self._start(measuring=True)

    def _learned(self, code: int, out: str, err: str) -> None:
        self._spared = False
        try:
            self._take(code, out, err)
        except (FfsegError, OSError) as error:  # a full disk
            self.line = f"what was learned cannot be kept: {error}"

    def _take(self, code: int, out: str, err: str) -> None:
        if code:
            self.line = f"nothing was learned: {last_line(err)}"
            return
        found = self._say(out)
        if found.measured or self._trusted:
            self._use(learned=found.of_use)
        kept = json.dumps({"of": self._of, "figures": out})
        write_bytes_atomic(self.project.path(LEARNED), kept.encode("ascii"))
        if self.project.learned_from() != self._of:
            self.learn(again=True)
        elif not self._measuring:
            self._measure()

    def _use(self, *, learned: bool) -> None:
        """Use what was learned from now on, or no model."""
        paths = self.project.path("learning.ffmodel"), self.project.path(MODEL)
        if learned:
            os.replace(*paths)
        for path in () if learned else paths:
            with suppress(FileNotFoundError):
                os.unlink(path)
        self._forget()
        self.generation += 1
        with self._changing:
            self.project.write_starts()

    def run(self) -> None:
        """Do the folder, anew where it was done before."""
        if self.runs:
            return
        with self._changing:
            self.project.write_starts()
        self.ran = f"running {counted(len(self.project.sources), 'image')}"
        self._running.start([*self.project.arguments(), "--json", "--quiet"])

    def _ran(self, code: int, out: str, err: str) -> None:
        if code not in (0, 3):
            self.ran = f"the run has failed: {last_line(err)}"
            return
        counts = json.loads(out)["counts"]
        failed = f", {counts['failed']} failed" if counts["failed"] else ""
        self.ran = f"the folder is done: {counted(counts['done'], 'image')}{failed}"
        self.project.review = self.project.path(RUN)
        self._forget()
        self.generation += 1

    def stop(self) -> None:
        """End what is at work."""
        self._learning.stop()
        self._running.stop()
