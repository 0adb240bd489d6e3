"""``python -m ffseg``, and the entry point of the ``ffseg`` command."""

from __future__ import annotations

import signal
import sys


def main() -> None:
    """Run the command line; never returns."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:  # a traceback of imports tells nobody anything
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from ffseg.cli.streams import harden, lost_output

    harden()
    if sys.platform != "win32" and sys.argv[1:2] == ["run"] and not {"-h", "--help", "--dry-run"} & set(sys.argv):
        # A worker takes as long to load OpenCV as this process takes to load Typer and read parameters: side by side.
        from ffseg.batch.workers.launch import launch_early

        launch_early()
    from ffseg.cli.app import main as command_line

    signal.signal(signal.SIGINT, handler)
    try:
        command_line()
    finally:  # the outcome stands: a signal that comes while Python ends must not change it
        for number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
            signal.signal(number, signal.SIG_IGN)
        lost = lost_output()
        if lost:
            print(f"ffseg: stdout could not be written ({lost}); what was to be printed is lost", file=sys.stderr)


if __name__ == "__main__":
    main()
