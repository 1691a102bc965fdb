"""A simulated machine and its daemon, as processes side by side in a directory that goes with them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from compd.configuration import Configuration
from compd.demo.processes import Command, run_commands


@contextmanager
def simulated_daemon(
    configuration: Configuration, seed: int, speedup: float, zero_hold_s: float, effects: Sequence[str] = ()
) -> Iterator[Path]:
    """Both run during the block; the directory with their sockets, `control.sock` and `compd.sock`.

    seed : of weather, joints and targets.  speedup : of the weather.  zero_hold_s : how long the machine stands at
    machine zero, s.  effects : hidden in the machine, as for `compd simulate --effect`.

    Raises DaemonError if one does not start.
    """
    with tempfile.TemporaryDirectory(prefix="compd-") as temporary:
        directory = Path(temporary)
        options = ["--seed", str(seed), "--speedup", str(speedup), "--zero-hold", str(zero_hold_s)]
        options += [f"--effect={effect}" for effect in effects]
        commands = [
            Command(
                ["simulate", str(configuration.path), "--directory", temporary, *options],
                ready=directory / "control.sock",
            ),
            Command(["run", str(directory / configuration.path.name)], ready=directory / "compd.sock"),
        ]
        with run_commands(commands, log=directory / "output.log"):
            yield directory
