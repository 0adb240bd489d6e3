"""``ffseg config``: list, show and check parameter sets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ffseg.cli import completion, console
from ffseg.cli.checks import checked_params
from ffseg.cli.examples import epilog
from ffseg.cli.group import Group
from ffseg.errors import ParameterError

app = typer.Typer(
    cls=Group,
    epilog=epilog("config"),
    help="List, show and check parameter sets.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.command("list", epilog=epilog("config list"))
def list_presets() -> None:
    """List the presets that come with ffseg: name, what for, file."""
    from ffseg.parameter_files import presets

    known = presets()
    width = max((len(name) for name in known), default=0)
    for name, path in known.items():
        comments = (line for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("#"))
        purpose = next((line.lstrip("# ") for line in comments if "$schema" not in line), "")  # that one is for editors
        console.data(f"{name:{width}}  {purpose}  ({path})")


@app.command(epilog=epilog("config show"))
def show(
    source: Annotated[
        str | None,
        typer.Argument(metavar="[PRESET|FILE]", autocompletion=completion.presets, help="Default: the defaults."),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", autocompletion=completion.settings, help="Override a key; may be repeated."
        ),
    ] = None,
) -> None:
    """Show every key of a parameter set as YAML, with what it means and what is allowed."""
    from ffseg.parameter_files import load_params
    from ffseg.parameter_text import to_yaml

    console.data(to_yaml(load_params(source, settings, allow_code=True)).rstrip("\n"))


@app.command(no_args_is_help=True, epilog=epilog("config check"))
def check(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE...", autocompletion=completion.presets, help="Parameter files or presets."),
    ],
) -> None:
    """Check parameter files: everything that is wrong, each with file and line; exit code 2 if anything is.

    Of a file that may be from ffseg 0.1 it says what to write into it for the results of then.
    """
    problems = []
    for file in files:
        try:
            checked_params(file)
            console.data(f"{console.escape(file)}: ok")
            _say_changes(file)
        except ParameterError as error:
            problems.append(str(error))
    if problems:
        raise ParameterError("\n".join(problems))


def _say_changes(file: str) -> None:
    """Tell on stderr what a sound file of ffseg 0.1 left to defaults that have changed since."""
    from ffseg.parameter_changes import since_0_1
    from ffseg.parameter_files import presets, written
    from ffseg.schema.nodes import Problems

    mine = file in presets() or Path(file).read_text(encoding="utf-8").startswith("# ffseg ")  # as tune begins a file
    lines = [] if mine else since_0_1(written(file, Problems()))
    if lines:
        console.message(f"{file}: of defaults that it leaves out some have changed; for results as in ffseg 0.1 add")
        console.message("\n".join(lines))


@app.command(epilog=epilog("config schema"))
def schema() -> None:
    """Print the JSON Schema of parameter files, for editors."""
    from ffseg.parameter_text import schema_file

    console.data(schema_file().rstrip("\n"))
