"""The page in a real browser: a simulated machine, its daemon, `compd page`, and Chromium that reaches nothing else."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from playwright.sync_api import Error as PlaywrightError
from playwright.sync_api import sync_playwright

from compd.demo.machine_zero import take_zero
from compd.demo.processes import Command, run_commands
from compd.simulation import ControlClient
from tests.support.paths import CONFIG
from tests.support.patience import PATIENCE_S
from tests.support.simulated import made_patient, run_directory

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or ""
# No name is resolved but this computer's own: what the page wants from elsewhere fails, and is seen.
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]
# The machine stands at machine zero until it is driven.
AT_REST = ("--zero-hold", "600")
_LOOK_EVERY_S = 0.05


@dataclass
class LivePage:
    """A page that is served. address : with its token. pid : of its process. machine : the simulation's control."""

    address: str
    pid: int
    directory: Path
    recordings: Path
    machine: ControlClient

    @property
    def socket(self) -> str:
        return str(self.directory / "compd.sock")


@contextmanager
def served(*options: str, name: str = "tripod-cmm.yaml", simulate: Sequence[str] = AT_REST) -> Iterator[LivePage]:
    """A machine with its zero taken, and its page; `options`: of `compd page`, `simulate`: of `compd sim run`."""
    with running_machine(name, simulate) as (directory, machine):
        recordings = directory / "recordings"
        with page_process(directory / "compd.sock", recordings, *options) as (address, pid):
            yield LivePage(address, pid, directory, recordings, machine)


@contextmanager
def running_machine(
    name: str = "tripod-cmm.yaml", simulate: Sequence[str] = AT_REST
) -> Iterator[tuple[Path, ControlClient]]:
    """A simulated machine and its daemon, zero taken; their directory, and the simulation's control.

    name : of a shipped machine, or the path of another.
    """
    with run_directory() as directory:
        shipped = CONFIG / name
        patient = directory / "patient" / shipped.name
        patient.parent.mkdir()
        # a browser that starts keeps simulated gauges from answering
        patient.write_text(made_patient(shipped.read_text()))
        commands = [
            Command(
                ["sim", "run", str(patient), "--directory", str(directory), *simulate],
                ready=directory / "control.sock",
            ),
            Command(["run", str(directory / shipped.name)], ready=directory / "compd.sock"),
        ]
        with run_commands(commands, log=directory / "output.log"):
            take_zero(directory / "compd.sock")
            with ControlClient(directory / "control.sock") as machine:
                yield directory, machine


@contextmanager
def page_process(unix_socket: Path, recordings: Path, *options: str) -> Iterator[tuple[str, int]]:
    """`compd page` on a free port; the address that it prints, and the number of its process.

    What else it prints is in `page.log` beside the directory of recordings.
    """
    words = ["page", "--daemon", str(unix_socket), "--port", "0", "--recordings", str(recordings), *options]
    with (recordings.parent / "page.log").open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "compd", *words], stdout=subprocess.PIPE, stderr=log, text=True
        )
    try:
        assert process.stdout is not None
        address = process.stdout.readline().removeprefix("open ").strip()
        assert address.startswith("http://"), address
        yield address, process.pid
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)


def memory_mb(pid: int) -> float:
    """What a process has in memory, MB."""
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return int(fields["VmRSS"].split()[0]) / 1e3


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium, driven by Playwright.

    It takes no processor time from the simulated machine and its daemon: without a graphics processor it would take
    a whole one, and gauges would answer late.
    """
    with sync_playwright() as playwright, TemporaryDirectory() as directory:
        last = Path(directory) / "chromium"
        last.write_text(f'#!/bin/sh\nexec nice -n 19 {CHROMIUM} "$@"\n')
        last.chmod(0o755)
        chromium = playwright.chromium.launch(executable_path=last, args=FLAGS)
        try:
            yield chromium
        finally:
            chromium.close()


@contextmanager
def opened(chromium: Any, page: LivePage, **options: Any) -> Iterator[Any]:
    """The page in a new window, once it shows a state; fails where it wanted anything from elsewhere, or its scripts
    failed."""
    context = chromium.new_context(**{"viewport": {"width": 1440, "height": 1000}, **options})
    tab = context.new_page()
    asked: list[str] = []
    failures: list[str] = []
    tab.on("request", lambda request: asked.append(request.url))
    tab.on("pageerror", lambda error: failures.append(str(error)))
    tab.on("console", lambda message: failures.append(message.text) if message.type == "error" else None)
    try:
        tab.goto(page.address, timeout=1e3 * PATIENCE_S)
        until(tab, "window.compd?.live?.setpoint && document.body.dataset.tone !== 'gone'")
        yield tab
        origin = page.address.partition("?")[0]
        assert [url for url in asked if not url.startswith(origin)] == []
        # a request that is refused is an error on the console, too
        assert [failure for failure in failures if "status of 4" not in failure] == []
    finally:
        context.close()


def until(tab: Any, expression: str, within_s: float = PATIENCE_S) -> None:
    """Wait until a JavaScript expression is true. (`wait_for_function` would need a page that allows `eval`.)

    An expression that fails is not true yet: after a click on a link the page may still be the one before, or be
    without the element that the expression reads.
    """
    failure = ""
    for _ in range(round(within_s / _LOOK_EVERY_S)):
        try:
            if tab.evaluate(expression):
                return
            failure = ""
        except PlaywrightError as error:
            failure = f": {error}"
        tab.wait_for_timeout(1e3 * _LOOK_EVERY_S)
    raise AssertionError(f"not within {within_s:g} s: {expression}{failure}")
