"""`--daemon`: one option, with one meaning, wherever a command talks to the daemon."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.options import DEFAULT_SOCKET, daemon_address
from docs.generate.command_entries import CommandEntry, entries
from tests.support.paths import CONFIG

ASKING = [
    *("status", "watch", "zero", "accept", "page", "gauge poll", "machine release", "model adopt", "model shadow"),
    *("recording start", "service upgrade", "service back"),
]


def by_name() -> dict[str, CommandEntry]:
    return {" ".join(entry.words): entry for entry in entries()}


def test_every_command_that_talks_to_the_daemon_has_the_same_option() -> None:
    options = {
        name: next((p for p in entry.command.params if p.name == "daemon"), None) for name, entry in by_name().items()
    }
    given = {name: option for name, option in options.items() if option is not None}
    assert sorted(given) == sorted(ASKING)
    assert {(*option.opts, option.help, option.default, option.nargs) for option in given.values()} == {
        ("--daemon", given["status"].help, DEFAULT_SOCKET, 1)
    }
    for way in ("Unix socket", "host:port", "configuration (YAML)"):
        assert way in given["status"].help


@pytest.mark.parametrize(
    ("daemon", "address"),
    [
        ("/run/compd/compd.sock", "/run/compd/compd.sock"),
        ("compd.sock", "./compd.sock"),
        ("10.1.2.3:7750", "10.1.2.3:7750"),
        ("[::1]:7750", "[::1]:7750"),
        (str(CONFIG / "hexapod.yaml"), "/run/compd/hexapod.sock"),
    ],
)
def test_a_daemon_is_named_by_its_socket_its_port_or_its_configuration(daemon: str, address: str) -> None:
    assert daemon_address(daemon) == address


def test_a_page_elsewhere_than_on_the_daemons_computer_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compd.page.run_page", lambda *_: pytest.fail("it serves"))
    result = CliRunner().invoke(app, ["page", "--daemon", "10.1.2.3:7750"])
    assert result.exit_code == 2
    assert "the page runs on the daemon's computer" in " ".join(result.output.replace("│", " ").split())


def test_a_socket_that_is_named_relative_to_the_folder_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["status", "--daemon", "s"])
    assert result.exit_code == 3
    assert "no daemon answers: No such file" in result.stdout
