"""The command line made of its commands: one alone where it is known which, all of them where not."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.commands import make_app
from docs.generate.command_entries import CommandEntry, entries

GROUPS = {
    "sim": {"run", "campaign", "fault", "tracker"},
    "model": {"effects", "effect", "add", "remove", "fit", "undo", "ledger", "adopt", "shadow"},
    "gauge": {"list", "show", "scan", "read", "watch", "learn", "poll", "test-driver"},
    "machine": {"new", "draw", "export", "release"},
    "recording": {"start", "replay", "join", "check", "merge", "convert", "exclude", "include"},
}


def loaded_by(*words: str) -> list[str]:
    """The modules that are loaded to make the command line of these words."""
    code = f"import sys; from compd.cli.commands import make_app; make_app(*{words}); print(*sys.modules)"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


@pytest.mark.parametrize(
    ("words", "module"), [(("run", "m.yaml"), "live.run"), (("recording", "start"), "measurements.recording.start")]
)
def test_a_command_that_is_named_is_loaded_alone(words: tuple[str, ...], module: str) -> None:
    commands = re.compile(r"compd\.cli\.(?:live|measurements|simulated|start)\..+")
    loaded = {name for name in loaded_by(*words) if commands.fullmatch(name)}
    assert loaded - {"compd.cli.measurements.recording"} == {f"compd.cli.{module}"}


@pytest.mark.parametrize("words", [(), ("status",)])
def test_help_needs_no_numbers(words: tuple[str, ...]) -> None:
    assert not {"numpy", "scipy"} & set(loaded_by(*words))


def test_the_top_has_few_commands_and_groups_with_the_others() -> None:
    inside = {entry.words[0]: set() for entry in entries()}
    for entry in entries():
        inside[entry.words[0]] |= set(entry.words[1:])
    assert len(inside) <= 22
    assert {group: inside[group] for group in GROUPS} == GROUPS


@pytest.mark.parametrize(("typed", "meant"), [("simm", "sim"), ("gauge pol", "poll"), ("recording strat", "start")])
def test_a_mistyped_command_is_answered_with_the_one_that_is_meant(typed: str, meant: str) -> None:
    result = CliRunner().invoke(make_app(*typed.split()), typed.split())
    assert result.exit_code == 2
    assert f"Did you mean '{meant}'?" in " ".join(result.output.replace("│", " ").split())


@pytest.mark.parametrize(
    ("typed", "number", "completed"),
    [
        ("compd che", 1, ["check"]),
        ("compd service u", 2, ["upgrade"]),
        ("compd recording st", 2, ["start"]),
        ("compd simu", 1, []),
    ],
)
def test_a_shell_completes_commands(typed: str, number: int, completed: list[str]) -> None:
    asked = {"_COMPD_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(number)}
    code = "import sys; sys.argv = ['compd']; from compd.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == completed


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
