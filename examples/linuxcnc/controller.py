"""LinuxCNC as a process: without a screen, as an ordinary user, on the motors of a simulated machine."""

from __future__ import annotations

import json
import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from compd.configuration import shipped_configuration
from compd.errors import DaemonError

# User for LinuxCNC, which refuses to run as root: present in every Debian, without files of its own.
ORDINARY_USER = "nobody"
START_S = 60.0
END_S = 30.0
POLL_S = 0.05
# Presses of a switch without effect, and the wait (s) for each.
PRESSES, PRESSED_S = 3, 1.0
# Longest wait (s) for the panel, above each of its own waits.
ANSWER_S = 90.0
LINKS = 6
# Text of a message about a late servo thread, which stops no program.
LATENESS = "realtime delay"
# Interval (s) of checks whether a program still runs.
LOOK_S = 1.0
# Distance within which corrections have reached their varying target, and the longest time (s) for it.
ARRIVED_MM, ARRIVED_S = 2e-4, 10.0
# Lock file: one LinuxCNC on a computer.
LOCK = Path("/tmp/linuxcnc.lock")
_HERE = Path(__file__).parent
_SCRIPTS = ("machine_link.py", "operator_panel.py")
SIMULATED_MACHINE = ("machine.hal", "probe.hal")


def obstacle() -> str:
    """Reason why LinuxCNC cannot be started on this computer, with the next step; "" if it can."""
    for program, package in (
        ("linuxcnc", "linuxcnc-uspace"),
        ("halcmd", "linuxcnc-uspace"),
        ("/usr/bin/python3", "python3"),
    ):
        if shutil.which(program) is None:
            return f"{program} is not installed: apt-get install {package} (Debian 12 or newer)"
    if LOCK.exists():
        return f"it runs already, or was killed: end it; where none runs, `halrun -U` and remove {LOCK}"
    return ""


def edited(text: str, changes: Iterable[tuple[str, str]]) -> str:
    """A shipped file with replaced passages, each of which occurs once."""
    for before, after in changes:
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text


def _ordinary_user() -> dict[str, Any]:
    """For subprocess: ORDINARY_USER, where this is root."""
    if os.geteuid() != 0:
        return {}
    return {"user": ORDINARY_USER, "group": pwd.getpwnam(ORDINARY_USER).pw_gid, "extra_groups": []}


class ProgramStopped(DaemonError):
    """LinuxCNC has ended a program with a message before its end; it can be run again."""


class LinuxCnc:
    """The shipped LinuxCNC machine in a directory of its own. A context manager: it runs in the block.

    motion_log : what its motors were commanded, and where the tip truly was: see `motion_log`.
    """

    def __init__(self, directory: Path, simulation: Path, hal_files: Sequence[str] = SIMULATED_MACHINE) -> None:
        """directory : to be made, with the controller's files. simulation : has control.sock of the simulated machine,
        compd.sock of the daemon, and artefact.json where there is something to probe. hal_files : of this folder, to be
        loaded as well; none for drives without a machine."""
        self.directory = directory
        self.motion_log = directory / "motion.log"
        self.programs = directory
        self._simulation = simulation
        self._hal_files = hal_files
        self._process: subprocess.Popen[bytes] | None = None
        self._panel: socket.socket | None = None
        self.errors: list[str] = []

    def __enter__(self) -> Self:
        if reason := obstacle():
            raise DaemonError.of("LinuxCNC", "cannot be started", next_step=reason)
        self._write_files()
        with (self.directory / "output.log").open("wb") as log:
            self._process = subprocess.Popen(
                ["linuxcnc", "-r", "machine.ini"],
                cwd=self.directory,
                env={**os.environ, "HOME": str(self.directory)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
                **_ordinary_user(),
            )
        try:
            self._panel = self._connect()
        except BaseException:  # Ctrl-C, too, leaves no LinuxCNC running
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._panel is not None:
            self._panel.sendall(b'{"do": "quit"}\n')
            self._panel.close()
        self._end()

    # --- what an operator does ------------------------------------------------------------------------

    def ask(self, do: str, timeout_s: float = ANSWER_S, **arguments: Any) -> Any:
        """A request to the panel, and its result. What LinuxCNC has shown meanwhile is appended to `errors`.

        Raises DaemonError if LinuxCNC has gone.
        """
        assert self._panel is not None
        self._panel.settimeout(timeout_s)
        answer = b""
        try:
            self._panel.sendall(json.dumps({"do": do, **arguments}).encode() + b"\n")
            while not answer.endswith(b"\n"):
                piece = self._panel.recv(1 << 16)
                if not piece:
                    raise self._problem("has ended")
                answer += piece
        except OSError as error:
            raise self._problem(f"does not answer: {error}") from error
        message = json.loads(answer)
        self.errors += message["errors"]
        return message["result"]

    def do(self, do: str, timeout_s: float = ANSWER_S, **arguments: Any) -> None:
        """A request that must succeed. Raises DaemonError with LinuxCNC's messages otherwise."""
        if not self.ask(do, timeout_s, **arguments):
            raise self._problem(f"did not {do} {arguments or ''}: {self.errors[-3:]}")

    def switch_on(self) -> None:
        """Switch on, and home at the present position, machine zero."""
        self.do("on")
        self.do("home")

    def arm(self) -> None:
        """Press the bridge's switch until it is armed. Raises DaemonError with its reason if it refuses."""
        for _ in range(PRESSES):
            if self.arms():
                return
        raise self._problem(f"the bridge does not arm: {self.held_by() or 'a setpoint was late'}")

    def arms(self) -> bool:
        """Press the bridge's switch once; return whether it is armed. It refuses after a late setpoint."""
        self.do("press", name="compd-arm")
        try:
            self.wait_for("compd.armed", True, PRESSED_S)
            # the feed is inhibited until the servo thread has run with it
            self.wait_for("compd-inhibit", False, PRESSED_S)
        except DaemonError:
            return False
        return True

    def held_by(self) -> str:
        """Reason of a held feed, "" for none. A program then waits until the bridge is armed again."""
        reason: str = self.ask("held_by")
        return reason

    def without_corrections(self) -> None:
        """Let the machine move even while the bridge is disarmed."""
        self.set_signal("compd-arm", "0")
        self.set_signal("compd-required", "0")

    def with_corrections(self) -> None:
        """Allow motion only with an armed bridge, arm it, and wait until the corrections have arrived.

        Raises DaemonError if it cannot be armed, or does not stay armed.
        """
        self.set_signal("compd-required", "1")
        self.arm()
        asked = [f"compd.link.{link}.offset" for link in range(LINKS)]
        applied = [f"limit3.{link}.out" for link in range(LINKS)]
        end_s = time.monotonic() + ARRIVED_S
        while True:
            values = self.values([*asked, *applied])
            if reason := self.held_by():
                raise self._problem(f"the bridge does not stay armed: {reason}")
            if all(abs(values[a] - values[b]) < ARRIVED_MM for a, b in zip(asked, applied, strict=True)):
                return
            if time.monotonic() > end_s:
                raise self._problem(f"limit3 does not follow the bridge: {values}")
            time.sleep(POLL_S)

    def set_signal(self, name: str, value: str) -> None:
        self.do("set_signal", name=name, value=value)

    def value(self, name: str) -> Any:
        return self.values([name])[name]

    def values(self, names: Sequence[str]) -> dict[str, Any]:
        """Values of pins and signals by name."""
        result: dict[str, Any] = self.ask("values", names=list(names))
        return result

    def wait_for(self, pin: str, value: Any, timeout_s: float = 10.0) -> None:
        """Return when a pin has a value. Raises DaemonError with the bridge's reason if it never has."""
        end_s = time.monotonic() + timeout_s
        while self.value(pin) != value:
            if time.monotonic() > end_s:
                raise self._problem(f"{pin} does not become {value}; compd.reason is {self.value('compd.reason')}")
            time.sleep(POLL_S / 5)

    def start(self, program: Path) -> None:
        """Begin a G-code program."""
        self.do("start", program=str(program))

    def run(self, program: Path, timeout_s: float, attend: Callable[[str], None] | None = None) -> tuple[float, float]:
        """Run a G-code program to its end; returns when it began and ended, s on CLOCK_MONOTONIC.

        attend : called with the reason, about once a second, while the feed is held: what an operator does then.

        Raises DaemonError if it does not come to its end; ProgramStopped where LinuxCNC shows an error.
        """
        shown, start_s = len(self.errors), time.monotonic()
        self.start(program)
        while not self.ask("wait_for_end", seconds=LOOK_S):
            held_by = self.held_by()
            if time.monotonic() - start_s > timeout_s:
                stands = f"the feed is held: {held_by}" if held_by else "the feed is not held"
                raise self._problem(f"{program.name} has not ended within {timeout_s:g} s; {stands}")
            if held_by and attend is not None:
                attend(held_by)
        errors = [error for error in self.errors[shown:] if LATENESS not in error]
        if errors:
            raise ProgramStopped(self._problem(f"stopped {program.name}: {errors}").problems)
        return start_s, time.monotonic()

    # --- process --------------------------------------------------------------------------------------

    def _write_files(self) -> None:
        self.directory.mkdir(parents=True)
        for file in sorted(shipped_configuration("linuxcnc/hexapod.ini").parent.iterdir()):
            if file.is_file():
                shutil.copy(file, self.directory)
        for name in (*_SCRIPTS, *self._hal_files):
            shutil.copy(_HERE / name, self.directory)
        (self.directory / "operator_panel.py").chmod(0o755)
        hal_files = "\n".join(f"HALFILE = {name}" for name in ("loopback_drives.hal", *self._hal_files))
        text = edited(
            (self.directory / "hexapod.ini").read_text(),
            (
                ("DISPLAY = axis", "DISPLAY = ./operator_panel.py"),
                ("SOCKET = /run/compd/hexapod.sock", f"SOCKET = {self._simulation / 'compd.sock'}"),
                ("HALFILE = loopback_drives.hal", hal_files),
            ),
        )
        text += f"\n[SIMULATION]\nLINK = ./machine_link.py\nDIRECTORY = {self._simulation}\n"
        (self.directory / "machine.ini").write_text(text)
        if os.geteuid() == 0:
            for path in (self.directory, *self.directory.iterdir(), *self._simulation.glob("*.sock")):
                shutil.chown(path, ORDINARY_USER)
            # so that the user can reach its own files
            self._simulation.chmod(0o711)

    def give(self, path: Path) -> None:
        """Give the controller's user a file written into the directory, or a new socket."""
        if os.geteuid() == 0:
            shutil.chown(path, ORDINARY_USER)

    def _connect(self) -> socket.socket:
        path, end_s = self.directory / "panel.sock", time.monotonic() + START_S
        assert self._process is not None
        while True:
            panel = socket.socket(socket.AF_UNIX)
            try:
                panel.connect(str(path))
                return panel
            except OSError:
                panel.close()
            if self._process.poll() is not None or time.monotonic() > end_s:
                raise self._problem("did not start")
            time.sleep(POLL_S)

    def _end(self) -> None:
        """LinuxCNC ends its parts itself after the panel's end; the rest is then killed."""
        assert self._process is not None
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
            subprocess.run(["halrun", "-U"], check=False, capture_output=True, **_ordinary_user())
            LOCK.unlink(missing_ok=True)

    def _problem(self, what: str) -> DaemonError:
        log = self.directory / "output.log"
        tail = log.read_text(errors="replace")[-3000:] if log.exists() else ""
        return DaemonError.of("LinuxCNC", what, next_step=f"read what it printed:\n{tail}")
