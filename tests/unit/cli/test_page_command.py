"""`compd page`: options that have no effect are refused with the command line to type."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from compd.cli.app import app


@pytest.mark.parametrize(
    ("words", "typed"),
    [
        ([], "compd page --listen 127.0.0.1 --tokens t.yaml"),
        (
            ["--daemon", "my machine.yaml", "--read-only"],
            "compd page --daemon 'my machine.yaml' --listen 127.0.0.1 --tokens t.yaml",
        ),
    ],
)
def test_tokens_that_no_browser_can_use_are_refused(monkeypatch, words, typed):
    monkeypatch.setattr("compd.page.run_page", lambda *_: pytest.fail("it serves"))
    done = CliRunner().invoke(app, ["page", *words, "--tokens", "t.yaml"], env={"COLUMNS": "400"})
    assert done.exit_code == 2
    assert typed in " ".join(done.output.replace("│", " ").split())
