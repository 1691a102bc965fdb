"""`compd run`: the daemon."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.loading import loading
from compd.cli.waiting import wait_for_file
from compd.live.system import exhaustion_named, require_descriptors, require_limits


def run(config: Annotated[Path, typer.Argument(help="The machine's configuration (YAML).")]) -> None:
    """Run the daemon: read the gauges, compute, publish, until SIGTERM or Ctrl-C.

    A configuration that is not there yet is waited for, for half a minute: `compd sim run` may be about to write it.
    """
    require_limits()
    with exhaustion_named():
        with loading():
            from compd.live import run as run_daemon
            from compd.machine_check import load_whole

            wait_for_file(config)
            configuration = load_whole(config)
        require_descriptors(len(configuration.lines))
        failed = run_daemon(configuration)
    sys.stdout.flush()
    sys.stderr.flush()
    # Python's own way to the end unloads every kernel first: a fifth of a second more without setpoints in a restart
    os._exit(int(failed))
