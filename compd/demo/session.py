"""The demo's session: a controller sends targets to the daemon, drives to its setpoints, and asks for the true tip."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from compd.arrays import rms
from compd.client import Client, connect
from compd.configuration import Configuration, ToolOnPlatformSettings
from compd.demo.machine_zero import ANSWER_TIMEOUT_S, take_zero
from compd.demo.processes import simulated_daemon
from compd.errors import CompdError, DaemonError
from compd.simulation import ControlClient

# Kinds of compensation: of nothing, of the joints, of joints and frame.
KINDS = ("none", "joints", "full")
# Speed-up of weather and warm-up: twenty seconds of demo are forty minutes.
SPEEDUP = 120.0
# Time (s) at machine zero, until the first drive; longer than the kernels take to compile.
ZERO_HOLD_S = 600.0
SETPOINT_RATE_HZ = 50.0
# Rest (s) at a target: a little longer than the period of the slowest gauge.
DWELL_S = 0.5
# Distance (mm) from the setpoint within which the links have arrived; they keep following its last micrometres.
ARRIVED_MM = 0.005
# Half edges (mm) of the box of targets about machine zero, within reach of every shipped machine.
REACH_MM = (60.0, 60.0, 40.0)
# How often the demo is run until it has a result.
ATTEMPTS = 2
# A result has at least so many points, and no larger share of missed cycles.
MIN_POINTS = 5
MAX_MISSED_SHARE = 0.05


@dataclass(frozen=True)
class DemoVisit:
    """One target, with the machine at rest there.

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
    """All visits and setpoints of a demo, and the daemon's STATUS at its end.

    cycles, missed : of the daemon's loop during the visits. expired : setpoints that had expired before the machine
    was driven to them. failure : what ended the session before its time; "" for nothing.
    """

    machine: str
    visits: list[DemoVisit] = field(default_factory=list)
    setpoints: list[dict[str, Any]] = field(default_factory=list)
    status: dict[str, Any] = field(default_factory=dict)
    cycles: int = 0
    missed: int = 0
    expired: int = 0
    failure: str = ""

    def rms_um(self, kind: str) -> float:
        """Tip error at the visits with a kind of compensation, um; nan without visits."""
        return rms([visit.error_um[kind] for visit in self.visits])

    @property
    def shortcoming(self) -> str:
        """Why this session is no result; "" where it is one."""
        due = self.cycles + self.missed
        if self.failure:
            return self.failure
        if self.missed > MAX_MISSED_SHARE * due:
            share = f"{100 * self.missed / due:.0f} %"
            return f"the daemon missed {share} of its cycles, allowed {100 * MAX_MISSED_SHARE:g} %"
        if self.expired:
            return f"setpoints that had expired before the machine was driven to them: {self.expired}"
        if len(self.visits) < MIN_POINTS:
            return f"the tip was measured at {len(self.visits)} points, needed {MIN_POINTS}"
        if self.rms_um("full") > self.rms_um("none"):
            return f"compensation made the tip worse: {self.rms_um('none'):.2f} -> {self.rms_um('full'):.2f} um"
        return ""


Watcher = Callable[[DemoSession, float, dict[str, Any]], None]


def run_demo(configuration: Configuration, seconds: float, seed: int, on_change: Watcher) -> DemoSession:
    """Start the simulated machine and the daemon for it, run a session of `seconds`, stop both.

    A session with a shortcoming is repeated, ATTEMPTS in all; the last one is returned.

    seed : of weather, joints and targets. on_change : see `run_session`. Raises CompdError for a machine without
    scales, and if one does not start.
    """
    if not configuration.wiring.scale:
        raise CompdError.of(
            "wiring",
            "has no `scale`, and the demo drives a machine by its scales",
            next_step="give another machine, or none for the shipped tripod",
        )
    for attempts_left in reversed(range(ATTEMPTS)):
        with simulated_daemon(configuration, seed, SPEEDUP, ZERO_HOLD_S) as directory:
            session = run_session(configuration, directory, seconds, seed, on_change)
        if not session.shortcoming or not attempts_left:
            break
    return session


def run_session(
    configuration: Configuration,
    directory: Path,
    seconds: float,
    seed: int,
    on_change: Watcher,
) -> DemoSession:
    """Visit random targets for `seconds` with the machine and daemon whose sockets are in `directory`.

    on_change : called as on_change(session, elapsed_s, setpoint) after every setpoint.
    """
    session = DemoSession(configuration.machine)
    try:
        take_zero(directory / "compd.sock")
        with (
            ControlClient(directory / "control.sock") as machine,
            connect(directory / "compd.sock", ANSWER_TIMEOUT_S) as observer,
            connect(directory / "compd.sock", ANSWER_TIMEOUT_S) as daemon,
        ):
            before = observer.status()["loop"]
            _visit_targets(session, configuration, machine, daemon, seconds, seed, on_change)
            session.status = observer.status()
            after = session.status["loop"]
            session.cycles = after["cycles"] - before["cycles"]
            session.missed = after["missed_cycles"] - before["missed_cycles"]
    except DaemonError as error:
        problem = error.problems[0]
        session.failure = f"{problem.where}: {problem.what}" + (f" ({problem.value})" if problem.value else "")
    return session


def _visit_targets(
    session: DemoSession,
    configuration: Configuration,
    machine: ControlClient,
    daemon: Client,
    seconds: float,
    seed: int,
    on_change: Watcher,
) -> None:
    """Drive to one target after the other, and measure the tip at each."""
    random = np.random.default_rng(seed)
    tool_moves = isinstance(configuration.geometry.tool, ToolOnPlatformSettings)
    next(daemon.watch(SETPOINT_RATE_HZ))  # the rate of `latest`
    start_s, elapsed_s, number = time.monotonic(), 0.0, 0
    while elapsed_s < seconds:
        number += 1
        target_mm = _next_target(configuration, random)
        target = {"tip_B0_mm": _in_B0(configuration, target_mm)} if tool_moves else {"tip_P_mm": target_mm}
        arrived_s = math.inf
        while elapsed_s < seconds:
            daemon.target(**{key: tip_mm.tolist() for key, tip_mm in target.items()}, id=number)  # again: it grows old
            setpoint = daemon.latest(ANSWER_TIMEOUT_S)
            session.setpoints.append(setpoint)
            elapsed_s = time.monotonic() - start_s
            on_change(session, elapsed_s, setpoint)
            if not _is_usable(setpoint, number):
                continue
            truth = machine.ask("DRIVE", scale_mm=setpoint["scale_setpoint_mm"])
            session.expired += time.monotonic() > setpoint["valid_until"]
            left_mm = np.abs(np.subtract(truth["scale_mm"], setpoint["scale_setpoint_mm"])).max()
            if left_mm > ARRIVED_MM:
                arrived_s = math.inf
            elif arrived_s == math.inf:
                arrived_s = elapsed_s
            elif elapsed_s - arrived_s >= DWELL_S:
                session.visits.append(_visit(machine, elapsed_s, target_mm, setpoint))
                break


def _is_usable(setpoint: dict[str, Any], number: int) -> bool:
    """Whether the machine may be driven to a setpoint now, for the target of this number."""
    answers = setpoint["valid"] and setpoint.get("target_id") == number
    return bool(answers and time.monotonic() < setpoint["valid_until"])


def _visit(machine: ControlClient, elapsed_s: float, target_mm: NDArray[Any], setpoint: dict[str, Any]) -> DemoVisit:
    """Tip errors of the commands of each kind of compensation now; the machine is at the last."""
    full = np.array(setpoint["scale_setpoint_mm"])
    none = full - np.array(setpoint["correction_mm"])
    commands = {"none": none, "joints": none + np.array(setpoint["sources_mm"]["joints"]), "full": full}
    error_um = {}
    for kind in KINDS:
        answer = machine.ask("TIP_FOR", scale_mm=commands[kind].tolist())
        error_um[kind] = float(np.linalg.norm(np.array(answer["tip_mm"]) - target_mm)) * 1e3
    return DemoVisit(elapsed_s, tuple(target_mm.tolist()), error_um, setpoint)


def _next_target(configuration: Configuration, random: np.random.Generator) -> NDArray[Any]:
    """(3,) random target in {M}, or on the workpiece in {P} with the tool on the plate."""
    tool = configuration.geometry.tool
    zero = np.array(tool.zero_tip_M_mm if isinstance(tool, ToolOnPlatformSettings) else tool.zero_tip_P_mm)
    return np.asarray(zero + random.uniform(-1.0, 1.0, 3) * REACH_MM)


def _in_B0(configuration: Configuration, tip_M_mm: NDArray[Any]) -> NDArray[Any]:
    """(3,) coordinates in {B0} of a place in {M}."""
    base = configuration.geometry.base
    rotation = Rotation.from_rotvec(base.rotation_B0_in_M_rad)
    return np.asarray(rotation.inv().apply(tip_M_mm - np.array(base.origin_B0_in_M_mm)))
