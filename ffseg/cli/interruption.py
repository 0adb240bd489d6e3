"""Signals end a run in order: its tables are written, and its workers ended."""

from __future__ import annotations

import os
import signal
from types import FrameType, TracebackType

from ffseg.cli import console

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Ctrl-C, the end asked for, and a terminal that has gone."""
_BASE = 128
"""A shell's exit code for a program ended by signal n is 128 + n."""


class Interruption:
    """Context manager that takes SIGINT, SIGTERM and SIGHUP over; at its end it tells that one came.

    Until `defer` is called a signal ends the program where it is; from then on it is only noted, and `descriptor`
    becomes readable. A SIGHUP that is ignored when this begins, as under ``nohup``, stays ignored.

    Attributes
    ----------
    signal : int
        0, or the signal that came.
    descriptor : int
        To wait on.
    """

    def __init__(self) -> None:
        self.signal = 0
        self._deferred = False
        self.descriptor, self._writer = -1, -1
        self._earlier: dict[int, object] = {}

    @property
    def exit_code(self) -> int:
        """128 + the signal that came."""
        return _BASE + self.signal

    def defer(self) -> None:
        """Only note signals from now on."""
        self._deferred = True

    def __enter__(self) -> Interruption:
        self.descriptor, self._writer = os.pipe()
        for number in SIGNALS:
            if number == getattr(signal, "SIGHUP", 0) and signal.getsignal(number) == signal.SIG_IGN:
                continue
            self._earlier[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._earlier.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        os.close(self.descriptor)
        os.close(self._writer)
        if self.signal:
            console.message("ffseg: interrupted; run it again to go on")
        if isinstance(error, KeyboardInterrupt) and self.signal:
            raise SystemExit(self.exit_code) from error

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - a handler's signature
        if self.signal:
            return  # it is ending already
        self.signal = number
        if not self._deferred:
            raise SystemExit(self.exit_code)
        os.write(self._writer, b"!")
