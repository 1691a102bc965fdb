"""Commands of compd, run in this process to save Python's start."""

from __future__ import annotations

from typer.testing import CliRunner

from compd.cli.app import app


def run_in_process(*arguments: str) -> str:
    """Output of a command. Raises RuntimeError with the output if it fails."""
    done = CliRunner().invoke(app, arguments)
    if done.exit_code:
        raise RuntimeError(f"compd {' '.join(arguments)}: {done.output}") from done.exception
    return done.stdout
