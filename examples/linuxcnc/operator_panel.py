#!/usr/bin/python3
"""Replacement of LinuxCNC's screen: carries out a person's actions on request over a Unix socket.

LinuxCNC starts it as its DISPLAY, and ends when it ends. Requests and answers are JSON objects, one a line, on
panel.sock in the working directory; `{"do": "home"}` calls `Operator.home`. Every answer has "result", and "errors":
what LinuxCNC has shown its operator since the last answer. Runs under the Python of LinuxCNC.
"""

from __future__ import annotations

import json
import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hal
import linuxcnc
from compd_arming import REASONS

POLL_S = 0.01
PRESS_S = 0.1
# Timeout (s) of LinuxCNC's answer to one command.
COMMAND_S = 15.0
SOCKET = Path("panel.sock")


class Operator:
    """One method per action; each returns its success or the requested value."""

    def __init__(self) -> None:
        self._command = linuxcnc.command()
        self._stat = linuxcnc.stat()
        self._errors = linuxcnc.error_channel()

    def on(self) -> bool:
        self._command.state(linuxcnc.STATE_ESTOP_RESET)
        self._command.wait_complete(COMMAND_S)
        self._command.state(linuxcnc.STATE_ON)
        return self._wait(lambda: bool(self._stat.task_state == linuxcnc.STATE_ON), COMMAND_S)

    def off(self) -> bool:
        self._command.state(linuxcnc.STATE_OFF)
        return self._wait(lambda: bool(self._stat.task_state != linuxcnc.STATE_ON), COMMAND_S)

    def home(self) -> bool:
        """Home every joint, where the machine stands."""
        self._in_joint_mode()
        self._command.home(-1)
        homed = self._wait(self._all_homed, COMMAND_S)
        self._command.teleop_enable(1)
        self._command.wait_complete(COMMAND_S)
        return homed

    def unhome(self) -> bool:
        self._in_joint_mode()
        self._command.unhome(-1)
        return self._wait(lambda: not self._all_homed(), COMMAND_S)

    def start(self, program: str) -> bool:
        """Begin a program; returns when it is running."""
        self._command.mode(linuxcnc.MODE_AUTO)
        self._command.wait_complete(COMMAND_S)
        self._command.program_open(program)
        self._command.wait_complete(COMMAND_S)
        self._command.auto(linuxcnc.AUTO_RUN, 0)
        return self._wait(lambda: bool(self._stat.interp_state != linuxcnc.INTERP_IDLE), COMMAND_S)

    def wait_for_end(self, seconds: float) -> bool:
        """Until the program has ended, or was aborted."""
        return self._wait(lambda: bool(self._stat.interp_state == linuxcnc.INTERP_IDLE), seconds)

    def abort(self) -> bool:
        self._command.abort()
        return self._wait(lambda: bool(self._stat.interp_state == linuxcnc.INTERP_IDLE), COMMAND_S)

    def values(self, names: list[str]) -> dict[str, Any]:
        """Values of pins and signals."""
        return {name: hal.get_value(name) for name in names}

    def held_by(self) -> str:
        """Reason of a held feed, in the bridge's words; "" for none."""
        if not hal.get_value("compd-inhibit"):
            return ""
        if hal.get_value("compd.armed"):
            return "the watchdog has bitten: no good setpoint came in time"
        return str(REASONS[hal.get_value("compd.reason")])

    def set_signal(self, name: str, value: str) -> bool:
        return subprocess.run(["halcmd", "sets", name, value], check=False).returncode == 0

    def press(self, name: str) -> bool:
        """Release a switch, and press it again, as slowly as a finger: a visible rising edge."""
        if not self.set_signal(name, "0"):
            return False
        time.sleep(PRESS_S)
        return self.set_signal(name, "1")

    def new_errors(self) -> list[str]:
        errors = []
        while error := self._errors.poll():
            errors.append(str(error[1]).strip())
        return errors

    def _in_joint_mode(self) -> None:
        self._command.mode(linuxcnc.MODE_MANUAL)
        self._command.wait_complete(COMMAND_S)
        self._command.teleop_enable(0)
        self._command.wait_complete(COMMAND_S)

    def _all_homed(self) -> bool:
        return all(self._stat.homed[: self._stat.joints])

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        end_s = time.monotonic() + timeout_s
        while time.monotonic() < end_s:
            self._stat.poll()
            if condition():
                return True
            time.sleep(POLL_S)
        return False


def main() -> None:
    operator = Operator()
    # hal.get_value works in a component alone
    component = hal.component("operator-panel")
    component.ready()
    SOCKET.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(SOCKET))
    listener.listen()
    connection, _ = listener.accept()
    with connection, connection.makefile("rwb") as lines:
        for line in lines:
            request = json.loads(line)
            if request["do"] == "quit":
                break
            result = getattr(operator, request.pop("do"))(**request)
            answer = {"result": result, "errors": operator.new_errors()}
            lines.write(json.dumps(answer).encode() + b"\n")
            lines.flush()
    component.exit()


if __name__ == "__main__":
    main()
