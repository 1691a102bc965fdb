"""`compd demo`: the main job on a simulated machine, on real wires, in twenty seconds."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

START_TIMEOUT_S = 180.0  # the first start on a machine compiles the kernels
DWELL_S = 0.6  # long enough for every gauge to be read anew after the machine has stopped
KINDS = ("none", "joints", "full")
SPEEDUP = 120.0  # twenty seconds of demo are forty minutes of warm-up


@dataclass(frozen=True)
class Visit:
    """One point, measured at rest: where the tool really was, three ways of commanding it.

    time_s : since the demo's start. target_M_mm : where it should have been.
    error_um : by kind of compensation, distance of the true tip from the target.
    """

    time_s: float
    target_M_mm: tuple[float, ...]
    error_um: dict[str, float]
    setpoint: dict[str, Any]


@dataclass
class Session:
    """Everything that the demo saw."""

    machine: str
    visits: list[Visit] = field(default_factory=list)
    setpoints: list[dict[str, Any]] = field(default_factory=list)
    status: dict[str, Any] = field(default_factory=dict)


class MachineController:
    """The simulated machine's own controller: drives to scale values and knows where the tip really is."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._lines = self._socket.makefile("rb")

    def ask(self, **message: Any) -> dict[str, Any]:
        """One request, one answer."""
        self._socket.sendall(json.dumps(message).encode() + b"\n")
        answer: dict[str, Any] = json.loads(self._lines.readline())
        if answer.get("class") == "ERROR":
            raise RuntimeError(f"simulated machine: {answer}")
        return answer

    def close(self) -> None:
        self._lines.close()
        self._socket.close()


@contextmanager
def processes(*commands: tuple[list[str], Callable[[], bool], str], log: Path) -> Iterator[None]:
    """Run commands in the background, each ready before the next starts; all stopped at the end."""
    running: list[subprocess.Popen[bytes]] = []
    try:
        with log.open("wb") as output:
            for command, ready, name in commands:
                process = subprocess.Popen(
                    [sys.executable, "-m", "compd", *command], stdout=output, stderr=output, start_new_session=True
                )
                running.append(process)
                _wait(ready, process, name, log)
            yield
    finally:
        for process in reversed(running):
            process.send_signal(signal.SIGTERM)
        for process in reversed(running):
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _wait(ready: Callable[[], bool], process: subprocess.Popen[bytes], name: str, log: Path) -> None:
    end = time.monotonic() + START_TIMEOUT_S
    while not ready():
        if process.poll() is not None or time.monotonic() > end:
            raise RuntimeError(f"{name} did not start; its output:\n{log.read_text()[-3000:]}")
        time.sleep(0.05)


def demo(
    config: Annotated[Path | None, typer.Argument(help="The machine; the shipped tripod if left out.")] = None,
    seconds: Annotated[float, typer.Option(min=5, help="How long it runs.")] = 20.0,
    page: Annotated[Path, typer.Option(help="Where the page with the pictures goes.")] = Path("out/demo.html"),
    seed: Annotated[int, typer.Option(help="Weather, joints and points follow from it.")] = 1,
) -> None:
    """Run a simulated machine, the daemon and a controller for 20 s; show what compensation gains."""
    from rich.console import Console

    from compd.cli.demo_page import summarise, write_demo_page
    from compd.configuration import load
    from compd.shipped import shipped_configuration

    console = Console()
    config = config or shipped_configuration("tripod-cmm.yaml")
    configuration = load(config)
    with tempfile.TemporaryDirectory(prefix="compd-") as temporary:
        directory = Path(temporary)
        log = directory / "output.log"
        simulate = ["simulate", str(config), "--directory", str(directory), "--seed", str(seed),
                    "--speedup", str(SPEEDUP)]  # fmt: skip
        derived = directory / config.name
        control, unix = directory / "control.sock", directory / "compd.sock"
        console.print(f"[bold]{configuration.machine}[/]: {len(configuration.gauges)} gauges on "
                      f"{len(configuration.lines)} lines, every one on a real pty or TCP port")  # fmt: skip
        with console.status("starting the simulated machine and the daemon (the first start compiles the kernels)"):
            background = processes(
                (simulate, control.exists, "compd simulate"),
                (["run", str(derived)], unix.exists, "compd run"),
                log=log,
            )
            background.__enter__()
        try:
            session = _run(console, directory, seconds, seed)
        finally:
            background.__exit__(None, None, None)
    console.print(summarise(session))
    page.parent.mkdir(parents=True, exist_ok=True)
    write_demo_page(page, session)
    console.print(f"The same as pictures: {page}")
