"""The command line made of its commands: one alone where it is known which, all of them where not."""

from __future__ import annotations

import subprocess
import sys

import pytest
from typer.testing import CliRunner

from compd.cli.commands import make_app


def test_a_command_that_is_named_is_loaded_alone():
    code = (
        "import sys; from compd.cli.commands import make_app; make_app('run'); "
        "print(sorted(name for name in sys.modules if name.startswith('compd.cli.live.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['compd.cli.live.run']"


def test_a_command_alone_is_still_called_by_its_name():
    result = CliRunner().invoke(make_app("run"), ["run", "--help"], prog_name="compd")
    assert result.exit_code == 0
    assert "compd run" in result.output


@pytest.mark.parametrize("mistyped", ["rnu", "--rnu", ""])
def test_what_is_no_command_is_told_from_all_of_them(mistyped):
    result = CliRunner().invoke(make_app(mistyped), ["zeroo"])
    assert result.exit_code == 2
    assert "zero" in result.output
