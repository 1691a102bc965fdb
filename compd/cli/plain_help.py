"""Commands whose help texts are plain text: brackets in them are printed, where typer takes them for markup."""

from __future__ import annotations

from copy import copy
from typing import Any, TypeVar

from typer.core import TyperCommand, TyperGroup

from compd.cli.old_names import take_address
from compd.cli.paths import check_paths

Printed = TypeVar("Printed")


class PlainCommand(TyperCommand):
    """A command. Its path arguments are checked before it begins."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the command line. Raises CompdError for a path that is empty or a folder."""
        typed = list(args)
        ctx.allow_extra_args = True
        rest: list[str] = super().parse_args(ctx, args)
        take_address(ctx, rest)
        if rest and not ctx.resilient_parsing:
            ctx.fail(f"Got unexpected extra argument{'s' * (len(rest) > 1)} ({' '.join(rest)})")
        if self.callback is not None and not ctx.resilient_parsing:
            check_paths(self.callback, ctx.params, typed)
        return rest

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help."""
        super(PlainCommand, _with_parameters_escaped(self)).format_help(ctx, formatter)


class PlainGroup(TyperGroup):
    """A group of commands; its help shows the first paragraph of each."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help."""
        printed = _with_parameters_escaped(self)
        printed.commands = {name: _escaped(command) for name, command in self.commands.items()}
        super(PlainGroup, printed).format_help(ctx, formatter)


def _with_parameters_escaped(command: Printed) -> Printed:
    printed: Any = _escaped(command)
    printed.params = [_escaped(parameter) for parameter in printed.params]
    return printed  # type: ignore[no-any-return]


def _escaped(described: Printed) -> Printed:
    """A copy of a command or parameter with a help text in which every bracket is literal."""
    from rich.markup import escape

    printed: Any = copy(described)
    for name in ("help", "short_help"):
        if text := getattr(printed, name, None):
            setattr(printed, name, escape(text))
    return printed  # type: ignore[no-any-return]
