"""SIGINT and SIGTERM as something a run can end for, with its tables written and its workers gone."""

from __future__ import annotations

import os
import signal
from types import FrameType, TracebackType

_BASE = 128
"""A shell's exit code for a program ended by signal n is 128 + n."""


class Interruption:
    """Context manager that takes SIGINT and SIGTERM over.

    Until `defer` is called a signal ends the program where it is; from then on it is only noted, and `descriptor`
    becomes readable.
    """

    def __init__(self) -> None:
        self._signal = 0
        self._deferred = False
        self._reader, self._writer = -1, -1
        self._earlier: dict[int, object] = {}

    @property
    def signal(self) -> int:
        """0, or the signal that came."""
        return self._signal

    @property
    def descriptor(self) -> int:
        """File descriptor to wait on."""
        return self._reader

    @property
    def exit_code(self) -> int:
        """128 + the signal that came."""
        return _BASE + self._signal

    def defer(self) -> None:
        """Only note signals from now on."""
        self._deferred = True

    def __enter__(self) -> Interruption:
        self._reader, self._writer = os.pipe()
        for number in (signal.SIGINT, signal.SIGTERM):
            self._earlier[number] = signal.signal(number, self._note)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._earlier.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        os.close(self._reader)
        os.close(self._writer)

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002 - a handler's signature
        if self._signal:
            return  # it is ending already
        self._signal = number
        if not self._deferred:
            raise SystemExit(self.exit_code)
        os.write(self._writer, b"!")
