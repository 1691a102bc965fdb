"""Every command of `compd` with its arguments and options, as typer knows them, for the pages that list them."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any, NamedTuple

import typer

from compd.cli.app import app
from compd.cli.commands import PANELS
from docs.generate.markdown import sentence

EXIT_CODES = """\
A command ends with exit code 0 when it has done what was asked; with 1 when the answer is no, where its text below says
so; and with 2 when its arguments, a file or the daemon cannot be used. Every problem is then on standard error: where
it is, what it is, what is allowed, and what to do.
"""
# How the kinds of values are written in a synopsis.
_VALUES = {"str": "TEXT", "path": "PATH", "int": "INTEGER", "float": "NUMBER"}


class CommandEntry(NamedTuple):
    """One command: its words after `compd`, the panel of the help that it stands in, typer's command and context."""

    words: tuple[str, ...]
    panel: str
    command: Any
    context: Any

    @property
    def name(self) -> str:
        return " ".join(("compd", *self.words))

    @property
    def group(self) -> bool:
        """Whether it has commands of its own and does nothing by itself."""
        return hasattr(self.command, "commands")

    @property
    def help(self) -> str:
        """Its text: paragraphs, the first one a line."""
        return inspect.cleandoc(self.command.help or "").replace("\f", "")

    @property
    def first_line(self) -> str:
        return self.help.partition("\n\n")[0].replace("\n", " ")

    @property
    def arguments(self) -> list[Any]:
        return [parameter for parameter in self._parameters if parameter.param_type_name == "argument"]

    @property
    def options(self) -> list[Any]:
        return [parameter for parameter in self._parameters if parameter.param_type_name == "option"]

    @property
    def _parameters(self) -> list[Any]:
        return [parameter for parameter in self.command.params if not parameter.hidden and parameter.name != "help"]

    @property
    def synopsis(self) -> str:
        """The command with its arguments and the options that are needed."""
        needed = [shown_option(parameter) for parameter in self.options if parameter.required]
        optional = ["[OPTIONS]"] if len(self.options) > len(needed) else []
        return " ".join([self.name, *map(_shown_in_synopsis, self.arguments), *needed, *optional])


def entries() -> list[CommandEntry]:
    """Every command, a group before the commands in it, in the order of the panels."""
    root = typer.main.get_command(app)
    context = root.make_context("compd", [], resilient_parsing=True)
    commands: Any = getattr(root, "commands")  # noqa: B009 - typer's type has no such attribute, its object has
    walked = [entry for command in commands.values() for entry in _walk(command, (), "", context)]
    return sorted(walked, key=lambda entry: list(PANELS).index(entry.panel))


def _walk(command: Any, words: tuple[str, ...], panel: str, parent: Any) -> Iterator[CommandEntry]:
    words = (*words, command.name)
    panel = panel or command.rich_help_panel
    context = command.make_context(command.name, [], parent=parent, resilient_parsing=True)
    yield CommandEntry(words, panel, command, context)
    for inside in getattr(command, "commands", {}).values():
        yield from _walk(inside, words, panel, context)


def shown_argument(parameter: Any) -> str:
    """The name of an argument."""
    return str(parameter.metavar or parameter.name.upper())


def _shown_in_synopsis(parameter: Any) -> str:
    return shown_argument(parameter) if parameter.required else f"[{shown_argument(parameter)}]"


def shown_option(parameter: Any) -> str:
    """The option with what it takes: `--rows INTEGER`, `--quick`."""
    names = " / ".join([*parameter.opts, *parameter.secondary_opts])
    if parameter.is_flag:
        return names
    kind = parameter.display_type(None).strip("<>").removesuffix(" range").removeprefix("list[").removesuffix("]")
    return f"{names} {_VALUES.get(kind.lower(), kind)}"


def shown_default(parameter: Any) -> str:
    """The value without the option; "" where there is none."""
    default = parameter.default
    if parameter.required or default is None or default is False or default in ("", ()):
        return ""
    return parameter.opts[0] if default is True else str(default)


def meaning(parameter: Any) -> str:
    """The help, with the range of a number."""
    low, high = getattr(parameter, "min", None), getattr(parameter, "max", None)
    limits = ""
    if low is not None:
        limits = f" {low:g} to {high:g}." if high is not None else f" {low:g} or more."
    elif high is not None:
        limits = f" {high:g} at most."
    several = " It may be given several times." if parameter.param_type_name == "option" and parameter.multiple else ""
    return sentence(parameter.help or "") + limits + several
