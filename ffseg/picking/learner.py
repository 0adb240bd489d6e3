"""``ffseg learn`` and ``ffseg run`` as processes of their own, behind what is picked and never in its way."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence

LEAST_MASKS = 2
"""A model is learned from so many: the figures of one say nothing."""


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


def figures_said(document: str) -> tuple[str, list[str], bool]:
    """What ``ffseg learn --json`` has found: a line to show, images the least sure first, and whether the model is of use."""
    found = json.loads(document)
    iou, without = found["iou"], found["without"]
    if iou is None or without is None:
        return f"learned from {found['masks']} masks, now measured on each left out", found.get("order") or [], True
    line = f"{found['masks']} masks: {_short(iou)} expected on the rest"
    more = found["more"]
    line += f"; {_gain(found['curve'])}" if more else "; more masks will hardly raise it"
    return line, found.get("order") or [], iou >= without  # without one, a run begins in the middle


def _gain(curve: Sequence[Sequence[float]]) -> str:
    rise = (curve[-1][1] - curve[-2][1]) / max(1, curve[-1][0] - curve[-2][0]) if len(curve) > 1 else 0.0
    return f"one more may raise it by about {_short(rise)}" if rise >= 0.005 else "more masks may still raise it"


def _short(value: float) -> str:
    return f"{value:.2f}".removeprefix("0") if value < 1 else "1.00"


def last_line(text: str) -> str:
    """What a command said last."""
    lines = [line for line in text.strip().splitlines() if line.strip()]
    return lines[-1].removeprefix("ffseg: error: ") if lines else ""
