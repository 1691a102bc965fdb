"""Names of 0.3 in place of the present ones: they work, and say the new one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.commands import make_app
from compd.cli.old_names import OLD_NAMES, SCRIPTS, renamed
from compd.release import __version__
from docs.generate.command_entries import entries
from tests.support.paths import ROOT


@pytest.mark.parametrize("old", OLD_NAMES)
def test_an_old_name_runs_the_present_command_and_says_its_name(old: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = renamed([*old.split(), "--help"])
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", f"`compd {old}` is now `compd {OLD_NAMES[old]}`; {GOES}\n")
    result = CliRunner().invoke(make_app(*words[:2]), words, prog_name="compd")
    assert result.exit_code == 0
    assert f"Usage: compd {OLD_NAMES[old]} " in result.output


GOES = "the old name goes with release 0.5"


def test_an_old_name_changes_neither_what_is_printed_nor_the_exit_code(tmp_path: Path) -> None:
    def printed(*words: str) -> tuple[int, str, str]:
        done = subprocess.run([sys.executable, "-m", "compd", *words], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout, done.stderr

    directory = str(tmp_path)
    new, old = printed("sim", "fault", directory), printed("fault", directory)
    assert new[0] == 2
    assert old == (*new[:2], f"`compd fault` is now `compd sim fault`; {GOES}\n{new[2]}")
    assert printed("effect", "show", "link_sag")[:2] == printed("model", "effect", "link_sag")[:2]


@pytest.mark.parametrize("old", SCRIPTS)
def test_what_is_a_script_now_says_which(old: str) -> None:
    done = subprocess.run([sys.executable, "-m", "compd", *old.split()], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"compd {old}: is a script now" in done.stderr
    assert f"run {SCRIPTS[old]} of a checkout" in done.stderr
    assert (ROOT / SCRIPTS[old]).is_file()


@pytest.mark.parametrize("words", [["sim", "run", "x"], ["gauge", "poll"], ["--version"], [], ["zeroo", "record"]])
def test_present_names_stay(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert renamed(words) == words
    assert capsys.readouterr().err == ""


def test_no_present_command_has_an_old_name() -> None:
    assert not set(OLD_NAMES) & {" ".join(entry.words) for entry in entries()}


@pytest.mark.parametrize("command", ["status", "watch", "zero", "page"])
def test_an_address_may_stand_without_its_option(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compd.cli.waiting.PATIENCE_S", 0.0)
    missing = tmp_path / "none.yaml"
    results = [CliRunner().invoke(app, [command, *words, str(missing)]) for words in ([], ["--daemon"])]
    assert f"`compd {command} {missing}` is now `compd {command} --daemon {missing}`" in results[0].stderr
    assert "is now" not in results[1].stderr
    assert results[0].exit_code == results[1].exit_code
    assert str(results[0].exception) == str(results[1].exception)
    assert results[0].stdout == results[1].stdout


@pytest.mark.parametrize("words", [["a", "b"], ["--daemon", "a", "b"]])
def test_more_than_an_address_is_refused(words: list[str]) -> None:
    result = CliRunner().invoke(app, ["status", *words])
    assert result.exit_code == 2
    assert "Got unexpected extra argument" in result.output


def test_the_old_names_go_with_the_release_that_they_say() -> None:
    assert tuple(map(int, __version__.split(".")[:2])) < (0, 5), "delete compd/cli/old_names.py and its callers"
