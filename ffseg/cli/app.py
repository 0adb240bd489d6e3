"""The ``ffseg`` command: subcommands loaded when named, and errors turned into exit codes."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.util import find_spec
from traceback import walk_tb
from typing import Annotated, Any

import typer

from ffseg import __version__
from ffseg.cli import console
from ffseg.cli.examples import epilog
from ffseg.cli.group import Group, with_words
from ffseg.errors import FfsegError, UsageError
from ffseg.plugins import described

COMMANDS = {
    "run": "ffseg.cli.commands.run",
    "segment": "ffseg.cli.commands.segment",
    "compare": "ffseg.cli.commands.compare",
    "pick": "ffseg.cli.commands.pick",
    "learn": "ffseg.cli.commands.learn",
    "tune": "ffseg.cli.commands.tune",
    "domain": "ffseg.cli.commands.domain",
    "bench": "ffseg.cli.commands.bench",
    "config": "ffseg.cli.commands.config",
    "samples": "ffseg.cli.commands.samples",
    "report": "ffseg.cli.commands.report",
    "merge": "ffseg.cli.commands.merge",
}
"""Module of each subcommand; it holds a function of the command's name, or a Typer ``app`` with commands of its own."""


class LazyGroup(Group):
    """A group that imports the module of a subcommand only when that subcommand is named or listed."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401, ARG002 - Typer's signature
        """Names of the subcommands, in the order of the documentation."""
        return [name for name, module in COMMANDS.items() if find_spec(module) is not None]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - Typer hides its command type
        """Import and build one subcommand; None when there is none of that name."""
        if cmd_name not in self.list_commands(ctx):
            return None
        module = import_module(COMMANDS[cmd_name])
        inner = getattr(module, "app", None) or _single(getattr(module, cmd_name), epilog(cmd_name))
        command = typer.main.get_command(inner)
        command.name = cmd_name
        return with_words(command)

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401 - Typer's signature
        """Run the subcommand; Typer ends an interrupt without a word, so it is said here."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            console.message("ffseg: interrupted; no file is half written; run it again")
            raise


app = typer.Typer(
    cls=LazyGroup,
    name="ffseg",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line; never returns.

    Exit codes: what the command gives; that of an `FfsegError`, mostly 2, shown as its sentence; 1 for anything unexpected, shown
    as one line that names the file holding the traceback; 130 after an interrupt.
    """
    try:
        _require_folder()
        app(prog_name="ffseg")
    except FfsegError as error:
        console.error(str(error))
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        console.message("ffseg: interrupted")
        sys.exit(130)
    except (Exception, SystemExit) as error:  # the last resort of the program
        if isinstance(error, SystemExit) and _is_ours(error):
            raise
        sentence = " ".join(described(error).split())[:200]
        console.error(f"unexpected {sentence}; the traceback is in {_traceback_file()}")
        sys.exit(1)


def _is_ours(error: SystemExit) -> bool:
    """Whether the command line ended the program, and no method, output or executor of somebody's, which may not."""
    frames = [frame.f_globals.get("__name__", "") for frame, _ in walk_tb(error.__traceback__)]
    return frames[-1].partition(".")[0] in ("ffseg", "click", "typer")


def _require_folder() -> None:
    """Refuse to work in a folder that has been removed, where no relative name means anything."""
    try:
        os.getcwd()
    except FileNotFoundError as error:
        raise UsageError("the folder you are in has been removed; change to another") from error


def _version(wanted: bool) -> None:
    if wanted:
        console.data(f"ffseg {__version__}")
        raise typer.Exit


@app.callback()
def ffseg(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Segment images with free-form active contours, one by one or by the folder."""


def _single(function: Any, below: str | None) -> typer.Typer:  # noqa: ANN401 - any annotated function
    single = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    single.command(no_args_is_help=True, epilog=below)(function)
    return single


def _traceback_file() -> str:
    import tempfile
    import traceback

    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="ffseg-traceback-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write(traceback.format_exc())
            return file.name
    except OSError:
        traceback.print_exc()
        return "the lines above"
