"""The page of the commands: every command of `compd` with its arguments and options, as typer knows them."""

from __future__ import annotations

from typing import Any

from compd.cli.commands import PANELS
from docs.generate.command_entries import (
    EXIT_CODES,
    CommandEntry,
    entries,
    meaning,
    shown_argument,
    shown_default,
    shown_option,
)
from docs.generate.markdown import code, escape, fence, heading, join, link, prose, table, target

INTRODUCTION = f"""\
`compd COMMAND --help` prints what stands here. Arguments in brackets may be left out; options may stand in any order.

{EXIT_CODES}"""


def page() -> str:
    """Markdown, from the commands themselves."""
    blocks = ["# Commands", INTRODUCTION]
    for panel in PANELS:
        rows = [[_link(entry), escape(entry.first_line)] for entry in entries() if entry.panel == panel]
        blocks += [f"**{panel}**", table(["command", "what it does"], rows)]
    for panel in PANELS:
        blocks += [heading(2, panel), *(_command(entry) for entry in entries() if entry.panel == panel)]
    return join(*blocks)


def _target(entry: CommandEntry) -> str:
    return target("commands", *entry.words)


def _link(entry: CommandEntry) -> str:
    return link(code(entry.name), _target(entry))


def _command(entry: CommandEntry) -> str:
    """One command: synopsis, help, arguments, options."""
    blocks = [heading(3, code(entry.name), _target(entry)), prose(entry.help)]
    if entry.group:
        return join(*blocks)
    blocks.append(fence(entry.synopsis))
    if entry.arguments:
        rows = [[code(shown_argument(parameter)), escape(meaning(parameter))] for parameter in entry.arguments]
        blocks.append(table(["argument", "meaning"], rows))
    if entry.options:
        rows = [[code(shown_option(p)), _default(p), escape(meaning(p))] for p in entry.options]
        blocks.append(table(["option", "default", "meaning"], rows))
    return join(*blocks)


def _default(parameter: Any) -> str:
    return "needed" if parameter.required else code(shown_default(parameter)) or "-"
