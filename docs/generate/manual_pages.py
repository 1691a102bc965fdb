"""The manual pages: compd(1), and one for each command, from the same entries as the page of the commands."""

from __future__ import annotations

import re
from collections.abc import Iterable

import typer

from compd.cli.app import app
from compd.cli.commands import PANELS
from compd.release import __version__
from docs.generate.command_entries import (
    EXIT_CODES,
    CommandEntry,
    entries,
    meaning,
    shown_argument,
    shown_default,
    shown_option,
)

_CODE_SPAN = re.compile(r"``(.+?)``|`([^`]+)`", re.DOTALL)


def manual_pages() -> dict[str, str]:
    """The pages in the language of man(7), by the names of their files: `compd-service-install.1`."""
    all_entries = entries()
    pages = {"compd.1": _main_page(all_entries)}
    for entry in all_entries:
        inside = [other for other in all_entries if other.words[:-1] == entry.words]
        pages[f"{_page_name(entry)}.1"] = _page_of(entry, inside)
    return pages


def _page_name(entry: CommandEntry) -> str:
    return entry.name.replace(" ", "-")


def _main_page(all_entries: Iterable[CommandEntry]) -> str:
    lines = [*_head("compd", typer.main.get_command(app).help or ""), "compd COMMAND [ARGUMENTS] [OPTIONS]"]
    for panel in PANELS:
        lines += [
            f'.SH "{_escaped(panel.upper())}"',
            *_list((e.name, e.first_line) for e in all_entries if e.panel == panel and len(e.words) == 1),
        ]
    return _lines([*lines, ".SH EXIT STATUS", _text(EXIT_CODES)])


def _page_of(entry: CommandEntry, inside: Iterable[CommandEntry]) -> str:
    synopsis = f"{entry.name} COMMAND" if entry.group else entry.synopsis
    lines = [*_head(_page_name(entry), entry.first_line), _escaped(synopsis), ".SH DESCRIPTION"]
    for paragraph in entry.help.split("\n\n"):
        lines += [".PP", _text(paragraph)]
    if entry.group:
        lines += [".SH COMMANDS", *_list((other.name, other.first_line) for other in inside)]
    if entry.arguments:
        lines += [".SH ARGUMENTS", *_list((shown_argument(p), meaning(p)) for p in entry.arguments)]
    if entry.options:
        lines += [".SH OPTIONS", *_list((shown_option(p), _with_default(p)) for p in entry.options)]
    above = "-".join(("compd", *entry.words[:-1]))
    return _lines([*lines, ".SH SEE ALSO", f".BR {_escaped(above)} (1)"])


def _with_default(parameter: object) -> str:
    default = shown_default(parameter)
    return meaning(parameter) + (f" Without it: {default}." if default else "")


def _head(name: str, summary: str) -> list[str]:
    return [
        f'.TH "{_escaped(name.upper())}" 1 "" "compd {__version__}" "compd"',
        *(".SH NAME", f"{_escaped(name)} \\- {_text(summary).rstrip('.')}", ".SH SYNOPSIS"),
    ]


def _list(items: Iterable[tuple[str, str]]) -> list[str]:
    return [line for name, text in items for line in (".TP", f"\\fB{_escaped(name)}\\fR", _text(text))]


def _text(text: str) -> str:
    """A paragraph, `code` in it bold."""
    return re.sub(_CODE_SPAN, r"\\fB\1\2\\fR", _escaped(" ".join(text.split())))


def _escaped(text: str) -> str:
    r"""Text of which nothing is a request: no backslash, and no point or apostrophe at the beginning of a line."""
    escaped = text.replace("\\", r"\e").replace("-", r"\-")
    return rf"\&{escaped}" if escaped[:1] in (".", "'") else escaped


def _lines(lines: Iterable[str]) -> str:
    return "\n".join(lines) + "\n"
