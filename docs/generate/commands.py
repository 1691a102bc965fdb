"""The page of the commands: every command of `compd` with its arguments and options, as typer knows them."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any, NamedTuple

import typer

from compd.cli.app import app
from compd.cli.commands import PANELS
from docs.generate.markdown import code, escape, fence, heading, join, link, prose, sentence, table, target

INTRODUCTION = """\
`compd COMMAND --help` prints what stands here. Arguments in brackets may be left out; options may stand in any order.

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


def entries() -> list[CommandEntry]:
    """Every command, a group before the commands in it, in the order of the panels."""
    root = typer.main.get_command(app)
    context = root.make_context("compd", [], resilient_parsing=True)
    commands: Any = getattr(root, "commands")  # noqa: B009 - typer's type has no such attribute, its object has
    walked = [entry for command in commands.values() for entry in _walk(command, (), "", context)]
    return sorted(walked, key=lambda entry: list(PANELS).index(entry.panel))


def page() -> str:
    """Markdown, from the commands themselves."""
    blocks = ["# Commands", INTRODUCTION]
    for panel in PANELS:
        rows = [[_link(entry), escape(_first_line(entry))] for entry in entries() if entry.panel == panel]
        blocks += [f"**{panel}**", table(["command", "what it does"], rows)]
    for panel in PANELS:
        blocks += [heading(2, panel), *(_command(entry) for entry in entries() if entry.panel == panel)]
    return join(*blocks)


def _walk(command: Any, words: tuple[str, ...], panel: str, parent: Any) -> Iterator[CommandEntry]:
    words = (*words, command.name)
    panel = panel or command.rich_help_panel
    context = command.make_context(command.name, [], parent=parent, resilient_parsing=True)
    yield CommandEntry(words, panel, command, context)
    for inside in getattr(command, "commands", {}).values():
        yield from _walk(inside, words, panel, context)


def _help(entry: CommandEntry) -> str:
    return inspect.cleandoc(entry.command.help or "").replace("\f", "")


def _first_line(entry: CommandEntry) -> str:
    return _help(entry).partition("\n\n")[0].replace("\n", " ")


def _target(entry: CommandEntry) -> str:
    return target("commands", *entry.words)


def _link(entry: CommandEntry) -> str:
    return link(code(entry.name), _target(entry))


def _command(entry: CommandEntry) -> str:
    """One command: synopsis, help, arguments, options."""
    blocks = [heading(3, code(entry.name), _target(entry)), prose(_help(entry))]
    if entry.group:
        return join(*blocks)
    parameters = [parameter for parameter in entry.command.params if not parameter.hidden and parameter.name != "help"]
    arguments = [parameter for parameter in parameters if parameter.param_type_name == "argument"]
    options = [parameter for parameter in parameters if parameter.param_type_name == "option"]
    needed = [_option(parameter) for parameter in options if parameter.required]
    optional = ["[OPTIONS]"] if len(options) > len(needed) else []
    blocks.append(fence(" ".join([entry.name, *map(_synopsis, arguments), *needed, *optional])))
    if arguments:
        blocks.append(table(["argument", "meaning"], [[code(_argument(p)), _meaning(p)] for p in arguments]))
    if options:
        blocks.append(
            table(["option", "default", "meaning"], [[code(_option(p)), _default(p), _meaning(p)] for p in options])
        )
    return join(*blocks)


def _argument(parameter: Any) -> str:
    return str(parameter.metavar or parameter.name.upper()).strip("[]" if str(parameter.metavar)[:1] == "[" else "")


def _synopsis(parameter: Any) -> str:
    return _argument(parameter) if parameter.required else f"[{_argument(parameter)}]"


def _option(parameter: Any) -> str:
    """The option with what it takes: `--rows INTEGER`, `--quick`."""
    names = " / ".join([*parameter.opts, *parameter.secondary_opts])
    if parameter.is_flag:
        return names
    kind = parameter.display_type(None).strip("<>").removesuffix(" range").removeprefix("list[").removesuffix("]")
    return f"{names} {_VALUES.get(kind.lower(), kind)}"


def _default(parameter: Any) -> str:
    if parameter.required:
        return "needed"
    default = parameter.default
    return "-" if default is None or default is False or default in ("", ()) else code(default)


def _meaning(parameter: Any) -> str:
    """The help, with the range of a number."""
    low, high = getattr(parameter, "min", None), getattr(parameter, "max", None)
    limits = ""
    if low is not None:
        limits = f" {low:g} to {high:g}." if high is not None else f" {low:g} or more."
    elif high is not None:
        limits = f" {high:g} at most."
    several = " It may be given several times." if parameter.param_type_name == "option" and parameter.multiple else ""
    return escape(sentence(parameter.help or "")) + limits + several
