"""What happens during the demo: a controller sends targets, drives to the setpoints, and looks where the tip is."""

from __future__ import annotations

import json
import math
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from compd.client import Client, connect
from compd.configuration import Configuration
from compd.configuration.geometry import ToolOnPlatformSettings
from compd.errors import DaemonError, Problem

KINDS = ("none", "joints", "full")
SETPOINT_RATE_HZ = 50.0
# At rest for as long as the slowest gauge needs to be read anew, and a little more.
DWELL_S = 0.5
# The links follow the setpoint's last micrometres all the time; nearer than this they are there.
ARRIVED_MM = 0.005
# Taking machine zero looks at the gauges for a second.
ANSWER_TIMEOUT_S = 15.0
# The targets: a box around machine zero that every shipped machine reaches.
REACH_MM = (60.0, 60.0, 40.0)


@dataclass(frozen=True)
class Visit:
    """One target, looked at when the machine is at rest there.

    time_s : since the start. target_mm : in {M}, or on the work in {P} with the tool on the plate.
    error_um : distance of the true tip from the target, by kind of compensation.
    setpoint : the SETPOINT message that was in force.
    """

    time_s: float
    target_mm: tuple[float, ...]
    error_um: dict[str, float]
    setpoint: dict[str, Any]


@dataclass
class DemoSession:
    """Everything that the demo saw."""

    machine: str
    visits: list[Visit] = field(default_factory=list)
    setpoints: list[dict[str, Any]] = field(default_factory=list)
    status: dict[str, Any] = field(default_factory=dict)


class MachineController:
    """The simulated machine's own controller: drives to scale values, and the truth about its tip."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self._socket.close()

    def ask(self, message_class: str, **values: Any) -> dict[str, Any]:
        """One request, one answer; DaemonError for an ERROR."""
        self._socket.sendall(json.dumps({"class": message_class, **values}).encode() + b"\n")
        answer: dict[str, Any] = json.loads(self._lines.readline())
        if answer.get("class") == "ERROR":
            raise DaemonError(Problem(where="simulated machine", what=str(answer.get("text")), value=message_class))
        return answer


def run_session(
    configuration: Configuration,
    directory: Path,
    seconds: float,
    seed: int,
    on_change: Callable[[DemoSession, float, dict[str, Any]], None],
) -> DemoSession:
    """Visit random targets for `seconds`; `on_change(session, elapsed_s, setpoint)` after every setpoint."""
    session = DemoSession(configuration.machine)
    random = np.random.default_rng(seed)
    tool_moves = isinstance(configuration.geometry.tool, ToolOnPlatformSettings)
    with (
        MachineController(directory / "control.sock") as machine,
        connect(directory / "compd.sock", ANSWER_TIMEOUT_S) as observer,
        connect(directory / "compd.sock", ANSWER_TIMEOUT_S) as daemon,
    ):
        setpoints = daemon.watch(SETPOINT_RATE_HZ)
        wait_for_gauges(observer, setpoints)
        observer.zero()
        start_s = time.monotonic()
        while (elapsed_s := time.monotonic() - start_s) < seconds:
            target_mm = _next_target(configuration, random)
            if tool_moves:
                daemon.target(tip_B0_mm=_in_B0(configuration, target_mm).tolist())
            else:
                daemon.target(tip_P_mm=target_mm.tolist())
            arrived_s = math.inf
            for setpoint in setpoints:
                session.setpoints.append(setpoint)
                elapsed_s = time.monotonic() - start_s
                on_change(session, elapsed_s, setpoint)
                if elapsed_s >= seconds:
                    break
                if not setpoint["valid"] or setpoint["mode"] != "machine_tool":
                    continue
                truth = machine.ask("DRIVE", scale_mm=setpoint["scale_setpoint_mm"])
                left_mm = np.abs(np.subtract(truth["scale_mm"], setpoint["scale_setpoint_mm"])).max()
                if left_mm > ARRIVED_MM:
                    arrived_s = math.inf
                elif arrived_s == math.inf:
                    arrived_s = elapsed_s
                elif elapsed_s - arrived_s >= DWELL_S:
                    session.visits.append(_visit(machine, elapsed_s, target_mm, setpoint))
                    break
        session.status = observer.status()
    return session


def wait_for_gauges(observer: Client, setpoints: Iterator[dict[str, Any]]) -> None:
    """Return once every gauge reads well; `setpoints` gives the pace."""
    for _ in setpoints:
        if all(gauge["quality"] == "ok" for gauge in observer.status()["gauges"]):
            return


def _visit(machine: MachineController, elapsed_s: float, target_mm: NDArray[Any], setpoint: dict[str, Any]) -> Visit:
    """Where the tip would be, now, for each kind of command; only the last is really driven to."""
    full = np.array(setpoint["scale_setpoint_mm"])
    none = full - np.array(setpoint["correction_mm"])
    commands = {"none": none, "joints": none + np.array(setpoint["sources_mm"]["joints"]), "full": full}
    error_um = {}
    for kind in KINDS:
        answer = machine.ask("TIP_FOR", scale_mm=commands[kind].tolist())
        error_um[kind] = float(np.linalg.norm(np.array(answer["tip_mm"]) - target_mm)) * 1e3
    return Visit(elapsed_s, tuple(target_mm.tolist()), error_um, setpoint)


def _next_target(configuration: Configuration, random: np.random.Generator) -> NDArray[Any]:
    """In {M}; on the work, in {P}, with the tool on the plate."""
    tool = configuration.geometry.tool
    zero = np.array(tool.zero_tip_M_mm if isinstance(tool, ToolOnPlatformSettings) else tool.zero_tip_P_mm)
    return np.asarray(zero + random.uniform(-1.0, 1.0, 3) * REACH_MM)


def _in_B0(configuration: Configuration, tip_M_mm: NDArray[Any]) -> NDArray[Any]:
    base = configuration.geometry.base
    rotation = Rotation.from_rotvec(base.rotation_B0_in_M_rad)
    return np.asarray(rotation.inv().apply(tip_M_mm - np.array(base.origin_B0_in_M_mm)))
