"""A group of commands whose list shows whole summaries, and that knows the nearest name of a mistyped one."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup


class Group(TyperGroup):
    """See the module."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - Typer's signature
        """Find the command, or say which name is near."""
        name, known = args[0] if args else "", self.list_commands(ctx)
        if name not in known and not name.startswith("-"):
            from ffseg.schema.kinds import nearest_word

            near = nearest_word(name, tuple(known)) or f"; choose one of {', '.join(known)}"
            ctx.fail(f"there is no command {name!r}{near}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - Typer's signature
        """List the commands, each with the whole first sentence of its help."""
        commands = ((name, self.get_command(ctx, name)) for name in self.list_commands(ctx))
        rows = [(name, _summary(command.help or "")) for name, command in commands if command is not None]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def _summary(text: str) -> str:
    """First paragraph of a help text, on one line."""
    return " ".join(text.partition("\n\n")[0].split())
