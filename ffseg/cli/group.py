"""A command group that lists whole summaries, suggests the nearest name for a mistyped one, and refuses empty values."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from typer.core import TyperGroup

from ffseg.errors import UsageError

_NUMBERS = {"int range": "integer", "integer range": "integer", "float range": "number"}
"""What a reader calls the kinds of numbers with limits."""


class Group(TyperGroup):
    """See the module."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - Typer's signature
        """Refuse empty values, as of unset variables: a path would silently be the working directory."""
        if not ctx.resilient_parsing:  # which the shell's completion asks for
            _require_values(args)
        return super().parse_args(ctx, args)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401 - Typer hides its command type
        """Find a command; None when there is none of that name."""
        return with_words(super().get_command(ctx, cmd_name))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - Typer's signature
        """Find the command, or say which name is near."""
        name, known = args[0] if args else "", self.list_commands(ctx)
        if name not in known and not name.startswith("-") and not ctx.resilient_parsing:
            from ffseg.schema.kinds import nearest_word

            near = nearest_word(name, tuple(known)) or f"; choose one of {', '.join(known)}"
            ctx.fail(f"there is no command {name!r}{near}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - Typer's signature
        """List the commands, each with the whole first sentence of its help."""
        commands = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        helps = ((name, (command.help or "").partition("\n\n")[0]) for name, command in commands if command is not None)
        rows = [(name, " ".join(first.split())) for name, first in helps]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def with_words(command: Any) -> Any:  # noqa: ANN401 - Typer hides its command type
    """Call the numbers a command takes by words a reader knows, in its help and its errors."""
    for parameter in command.params if command is not None else ():
        parameter.type.name = _NUMBERS.get(parameter.type.name, parameter.type.name)
    return command


def _require_values(args: Sequence[str]) -> None:
    """Refuse an argument that is empty, and an option written with an empty value."""
    for before, text in zip(("", *args), args, strict=False):
        if text == "" or re.fullmatch("--[a-z-]+=", text):
            option = text[:-1] or (before if before.startswith("-") else "")
            what = f"the value of {option}" if option else "an argument"
            raise UsageError(f"{what} is empty, as of an unset variable; give one, . for the folder you are in")
