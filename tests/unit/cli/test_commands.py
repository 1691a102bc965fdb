"""The command line made of its commands: one alone where it is known which, all of them where not."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.commands import make_app
from docs.generate.command_entries import CommandEntry, entries


def test_a_command_that_is_named_is_loaded_alone():
    code = (
        "import sys; from compd.cli.commands import make_app; make_app('run'); "
        "print(sorted(name for name in sys.modules if name.startswith('compd.cli.live.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['compd.cli.live.run']"


@pytest.mark.parametrize(
    ("typed", "number", "completed"), [("compd che", 1, "check"), ("compd service u", 2, "upgrade")]
)
def test_a_shell_completes_commands(typed: str, number: int, completed: str) -> None:
    asked = {"_COMPD_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(number)}
    code = "import sys; sys.argv = ['compd']; from compd.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == [completed]


def test_a_command_alone_is_still_called_by_its_name():
    result = CliRunner().invoke(make_app("run"), ["run", "--help"], prog_name="compd")
    assert result.exit_code == 0
    assert "compd run" in result.output


@pytest.mark.parametrize("mistyped", ["rnu", "--rnu", ""])
def test_what_is_no_command_is_told_from_all_of_them(mistyped):
    result = CliRunner().invoke(make_app(mistyped), ["zeroo"])
    assert result.exit_code == 2
    assert "zero" in result.output


def words(text: str) -> str:
    """Without blanks and the lines of a box, which stand where a terminal breaks a text."""
    return "".join(text.replace("│", " ").split())


@pytest.mark.parametrize("entry", entries(), ids=lambda entry: entry.name)
def test_the_help_of_a_command_prints_every_text_as_it_stands_in_the_code(entry: CommandEntry, monkeypatch):
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 1000)
    printed = words(CliRunner().invoke(app, [*entry.words, "--help"]).output)
    assert words(inspect.cleandoc(entry.command.help)) in printed
    for parameter in entry.command.params:
        assert words(parameter.help or "") in printed, parameter.name
    for command in getattr(entry.command, "commands", {}).values():
        assert words(command.help.partition("\n\n")[0]) in printed, command.name


def test_the_list_of_commands_prints_every_first_line(monkeypatch):
    monkeypatch.setattr("typer.rich_utils.MAX_WIDTH", 1000)
    printed = words(CliRunner().invoke(app, ["--help"]).output)
    for entry in entries():
        if len(entry.words) == 1:
            assert words(inspect.cleandoc(entry.command.help).partition("\n\n")[0]) in printed, entry.name
