"""`compd run`: the daemon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compd.cli.loading import loading


def run(config: Annotated[Path, typer.Argument(help="The machine's configuration (YAML).")]) -> None:
    """Run the daemon: read the gauges, compute, publish, until SIGTERM or Ctrl-C."""
    with loading():
        from compd.live.run import run as run_daemon
        from compd.machine_check import load_whole

        configuration = load_whole(config)
    failed = run_daemon(configuration)
    if failed:
        raise typer.Exit(1)
