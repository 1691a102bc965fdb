"""`compd run`: the daemon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def run(config: Annotated[Path, typer.Argument(help="The machine's configuration (YAML).")]) -> None:
    """Run the daemon: read the gauges, compute, publish, until SIGTERM or Ctrl-C."""
    from compd.configuration import load
    from compd.live.run import run as run_daemon

    failed = run_daemon(load(config))
    if failed:
        raise typer.Exit(1)
