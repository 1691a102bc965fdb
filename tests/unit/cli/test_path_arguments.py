"""Every path argument of every command, given what is no file: a sentence that says what to do, and no traceback."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import typer

import compd
from compd.cli.app import app
from compd.cli.paths import PathKind, PathParameter, path_parameters
from compd.errors import CompdError, RecordingError
from compd.table_file import written_path


def commands(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    inside = getattr(command, "commands", {})
    if not inside:
        yield words, command
    for name, each in inside.items():
        yield from commands(each, (*words, name))


CASES = [
    pytest.param(words, command, parameter, id=f"{' '.join(words)} {parameter.name}")
    for words, command in commands(typer.main.get_command(app))
    for parameter in path_parameters(command.callback)
]
NEEDED = {"kind": "6-ups"}


def typed(command: Any, parameter: PathParameter, value: str) -> list[str]:
    """The command line with this value, and "x" for whatever else is needed."""
    line: list[str] = []
    for each in command.params:
        given = value if each.name == parameter.name else NEEDED.get(each.name, "x") if each.required else None
        if given is not None:
            line += [given] if each.param_type_name == "argument" else [each.opts[0], given]
    return line


@pytest.mark.parametrize(("words", "command", "parameter"), CASES)
def test_no_path_argument_ends_in_a_traceback(words, command, parameter, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    bad = {
        PathKind.FILE: ["", ".", "/", "folder", str(tmp_path)],
        PathKind.NAME_OR_FILE: ["", ".", "/", str(tmp_path)],
        PathKind.FOLDER: ["", "/", "file"],
        PathKind.ANY: ["", "/"],
    }[parameter.kind]
    for value in bad:
        if value == "" and command_default(command, parameter) == "":
            continue
        with pytest.raises(CompdError) as refused:
            command.main(typed(command, parameter, value), standalone_mode=False)
        about = [problem for problem in refused.value.problems if repr(value) in problem.where]
        assert about, refused.value
        assert about[0].next_step


def command_default(command: Any, parameter: PathParameter) -> object:
    return next(each.default for each in command.params if each.name == parameter.name)


def test_a_text_that_may_be_a_file_has_a_kind():
    known = {f"{' '.join(words)} {parameter.name}" for words, _, parameter in (case.values for case in CASES)}
    assert len(known) > 100
    for words, command in commands(typer.main.get_command(app)):
        for name, hint in get_type_hints(inspect.unwrap(command.callback), include_extras=True).items():
            help_ = next((each.help for each in getattr(hint, "__metadata__", ()) if getattr(each, "help", None)), "")
            if re.search(r"\bfile \(|FILE|\(YAML\)|/file\.py|socket", help_):
                assert f"{' '.join(words)} {name}" in known


@pytest.mark.parametrize("path", [".", "/", ""])
def test_the_same_in_python(path):
    with pytest.raises(RecordingError, match="is a folder"):
        compd.open_recording(path)
    with pytest.raises(RecordingError, match="is a folder"):
        written_path(Path(path))
