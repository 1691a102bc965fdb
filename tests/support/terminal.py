"""A page's terminal: the commands of its console fences, run in order, and what they print compared."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from compd.client import connect
from compd.demo.machine_zero import wait_for_gauges
from tests.support.paths import CONFIG, ROOT
from tests.support.ports import free_port
from tests.support.simulated import HEXAPOD, TRIPOD, made_patient
from tests.support.staging import make_stage, staged

# What the pages write, and what it is while a test runs.
MACHINE = "/tmp/machine"
WIDTH = "100"
TIMEOUT_S = 200.0
# The first start of the daemon compiles the kernels.
START_S = 60.0
POLL_EVERY_S = 0.05
# Sockets that exist once these commands are ready for the next one.
READY = {"compd sim run": "control.sock", "compd run": "compd.sock"}
# Other programs that serve until they are ended. They are ready when they have printed what the page shows.
SERVERS = ("mosquitto",)
# The port of a broker that pages start; while a test runs, one that is free.
BROKER_PORT = "1884"
KILL = re.compile(r"kill %(\d+)")
EXIT_CODE = re.compile(r"#.*\bexit code (\d+)")


class Shown(NamedTuple):
    """A command as a page shows it, and the lines that it prints; `interrupt`: it is ended with Ctrl-C after them."""

    command: str
    beside: bool
    prints: list[str]
    interrupt: bool


def shown_commands(console: str) -> Iterator[Shown]:
    """Those of a console fence: lines that begin with `$ `, continued after a backslash, their output below them."""
    lines = [line.rstrip() for line in console.splitlines() if line.strip()]
    starts = [number for number, line in enumerate(lines) if line.startswith("$ ")]
    assert starts[:1] == [0], f"a console fence begins with a command: {lines[:1]}"
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        command, first = lines[start][2:], start + 1
        while command.endswith("\\"):
            command = command[:-1] + lines[first].removeprefix("> ")
            first += 1
        beside = command.endswith("&")
        prints = lines[first:end]
        yield Shown(command.rstrip("& "), beside, [line for line in prints if line != "^C"], "^C" in prints)


def without_numbers(line: str) -> str:
    """The words of a line: numbers, their bars, and how wide they make a table, change from run to run."""
    line = re.sub("█+", " ", line)
    line = re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", line)
    return " ".join(re.sub("([━─])+", r"\1", line).split())


def missing_line(shown: Shown, output: str) -> str | None:
    """The first line of the page that is not there in its order; `...` stands for anything, alone for any lines."""
    printed = iter([without_numbers(line) for line in output.splitlines()])
    for line in shown.prints:
        wanted = re.compile(".*".join(map(re.escape, without_numbers(line).split("..."))))
        if line != "..." and not any(wanted.fullmatch(text) for text in printed):
            return line
    return None


def is_printed(shown: Shown, output: str) -> bool:
    return missing_line(shown, output) is None


def check_printed(shown: Shown, output: str) -> None:
    line = missing_line(shown, output)
    assert line is None, f"$ {shown.command}\n{line!r} is not in\n{output}"


class Terminal:
    """A directory with the checkout's `drivers`, `examples` and patient `config`, and the processes that run there."""

    def __init__(self, directory: Path, installs: bool = False) -> None:
        """installs : the page installs into the system; a stage stands in for it."""
        self.directory = directory
        self._stage = make_stage(directory) if installs else None
        self._beside: list[tuple[str, subprocess.Popen[bytes], bool]] = []
        self._logs: list[Path] = []
        for folder in ("drivers", "examples"):
            (directory / folder).symlink_to(ROOT / folder)
        shutil.copytree(CONFIG, directory / "config")
        for machine in (TRIPOD, HEXAPOD):
            (directory / "config" / machine.name).write_text(made_patient(machine.read_text()))
        self._broker_port = str(free_port())

    def run(self, console: str) -> None:
        """Run a console fence."""
        for shown in shown_commands(self._in_test(console)):
            print("$", shown.command, "&" * shown.beside)
            if shown.command.startswith("make "):
                # minutes each: .ci/run runs them
                assert f"\n{shown.command.partition('#')[0].strip()}\n" in (ROOT / ".ci" / "run").read_text()
            elif shown.beside:
                self._start(shown)
            elif job := KILL.fullmatch(shown.command.partition("#")[0].strip()):
                self._stop(int(job[1]))
            else:
                self._run(shown)

    def write(self, name: str, text: str) -> None:
        """Write a file that the page shows."""
        path = self.directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(self._in_test(text), encoding="utf-8")

    def close(self) -> None:
        """Wait for what ends by itself, stop what serves; raises where one has failed."""
        failed = []
        try:
            for command, process, serves in reversed(self._beside):
                if serves:
                    process.terminate()
                if process.wait(TIMEOUT_S) not in ((0, -signal.SIGTERM) if serves else (0,)):
                    failed.append(command)
        finally:
            for _, process, _ in self._beside:
                process.kill()
        assert not failed, f"failed beside the others: {failed}\n{self._log()}"

    def _in_test(self, text: str) -> str:
        """The text of a page with the directory and the port of this test."""
        return text.replace(MACHINE, str(self.directory / "machine")).replace(BROKER_PORT, self._broker_port)

    def _start(self, shown: Shown) -> None:
        """Start a command that runs beside the rest; return when it is ready and has printed what the page shows."""
        command = shown.command
        words = shlex.split(command, comments=True)
        ready = self._ready_socket(words)
        log = self.directory / f"beside-{len(self._logs) + 1}.log"
        self._logs.append(log)
        with log.open("wb") as output:
            process = self._popen(f"exec {command}", output.fileno())
        self._beside.append((command, process, ready is not None or words[0] in SERVERS))
        end_s = time.monotonic() + START_S
        while not ((ready is None or ready.exists()) and is_printed(shown, log.read_text(errors="replace"))):
            if process.poll() is not None or time.monotonic() > end_s:
                assert ready is None or ready.exists(), f"{command} did not start\n{self._log()}"
                check_printed(shown, log.read_text(errors="replace"))
                return
            # until the process ends, or it is time to look again
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(POLL_EVERY_S)

    def _stop(self, job: int) -> None:
        """End what was started last beside the others; the shell gives the number of that job to the next one."""
        assert job == len(self._beside), f"kill %{job}: the job that was started last is %{len(self._beside)}"
        command, process, _ = self._beside.pop()
        process.terminate()
        code = process.wait(TIMEOUT_S)
        assert code in (0, -signal.SIGTERM), f"{command}: exit code {code}\n{self._log()}"

    def _ready_socket(self, words: list[str]) -> Path | None:
        """The socket that a command which serves others makes; None for one that ends by itself."""
        socket = READY.get(" ".join(words[:3]), READY.get(" ".join(words[:2])))
        if socket is None:
            return None
        if "--directory" in words:
            return self.directory / words[words.index("--directory") + 1] / socket
        return (self.directory / words[2]).parent / socket

    def _run(self, shown: Shown) -> None:
        words = shlex.split(shown.command, comments=True)
        if words[:3] == ["compd", "zero", "--daemon"]:
            # a person types slower than gauges come up
            with connect(words[3]) as observer, connect(words[3]) as daemon:
                wait_for_gauges(observer, daemon.watch(10.0))
        with self._popen(shown.command, subprocess.PIPE) as process:
            clock = threading.Timer(TIMEOUT_S, process.kill)
            clock.start()
            try:
                output = self._interrupted(process, shown) if shown.interrupt else process.communicate()[0].decode()
            finally:
                clock.cancel()
                process.kill()
        print(output, end="")
        wanted = EXIT_CODE.search(shown.command)
        allowed = {int(wanted[1])} if wanted else {0, -signal.SIGINT, 128 + signal.SIGINT} if shown.interrupt else {0}
        assert process.returncode in allowed, (
            f"$ {shown.command}\nexit code {process.returncode}\n{output}{self._log()}"
        )
        check_printed(shown, output)

    def _interrupted(self, process: subprocess.Popen[bytes], shown: Shown) -> str:
        """Read until the lines that the page shows have come, then press Ctrl-C."""
        assert process.stdout is not None
        output, expected = "", [line for line in shown.prints if line != "..."]
        for line in process.stdout:
            output += line.decode()
            if len(output.splitlines()) >= len(expected):
                break
        os.killpg(process.pid, signal.SIGINT)
        return output + process.stdout.read().decode()

    def _popen(self, command: str, output: int) -> subprocess.Popen[bytes]:
        paths = [str(Path(sys.executable).parent), os.environ["PATH"], "/usr/sbin"]
        variables: dict[str, str] = {}
        if self._stage is not None:
            command = staged(command, self._stage)
            paths.insert(0, str(self._stage / "bin"))
            variables["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
        return subprocess.Popen(
            ["bash", "-c", command],
            cwd=self.directory,
            env={
                **os.environ,
                **variables,
                "PATH": os.pathsep.join(paths),
                "COLUMNS": WIDTH,
                "NO_COLOR": "1",
                "PYTHONUNBUFFERED": "1",
            },
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def _log(self) -> str:
        return "\n".join(log.read_text(errors="replace")[-4000:] for log in self._logs)
