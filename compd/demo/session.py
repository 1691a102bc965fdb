"""The demo's session: a controller sends targets to the daemon, drives to its setpoints, and asks for the true tip."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from compd.client import Client, connect
from compd.configuration import Configuration, ToolOnPlatformSettings
from compd.demo.simulated_daemon import simulated_daemon
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
# Timeout (s) of taking machine zero, which averages the gauges for a second.
ANSWER_TIMEOUT_S = 15.0
# Half edges (mm) of the box of targets about machine zero, within reach of every shipped machine.
REACH_MM = (60.0, 60.0, 40.0)


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
    """All visits and setpoints of a demo, and the daemon's STATUS at its end."""

    machine: str
    visits: list[DemoVisit] = field(default_factory=list)
    setpoints: list[dict[str, Any]] = field(default_factory=list)
    status: dict[str, Any] = field(default_factory=dict)


Watcher = Callable[[DemoSession, float, dict[str, Any]], None]


def run_demo(configuration: Configuration, seconds: float, seed: int, on_change: Watcher) -> DemoSession:
    """Start the simulated machine and the daemon for it, run a session of `seconds`, stop both.

    seed : of weather, joints and targets. on_change : see `run_session`. Raises DaemonError if one does not start.
    """
    with simulated_daemon(configuration, seed, SPEEDUP, ZERO_HOLD_S) as directory:
        return run_session(configuration, directory, seconds, seed, on_change)


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
    random = np.random.default_rng(seed)
    tool_moves = isinstance(configuration.geometry.tool, ToolOnPlatformSettings)
    with (
        ControlClient(directory / "control.sock") as machine,
        connect(directory / "compd.sock", ANSWER_TIMEOUT_S) as observer,
        connect(directory / "compd.sock", ANSWER_TIMEOUT_S) as daemon,
    ):
        setpoints = daemon.watch(SETPOINT_RATE_HZ)
        wait_for_gauges(observer, setpoints)
        observer.zero()
        start_s = time.monotonic()
        while (elapsed_s := time.monotonic() - start_s) < seconds:
            target_mm = _next_target(configuration, random)
            target = {"tip_B0_mm": _in_B0(configuration, target_mm)} if tool_moves else {"tip_P_mm": target_mm}
            arrived_s = math.inf
            for setpoint in setpoints:
                daemon.target(**{key: tip_mm.tolist() for key, tip_mm in target.items()})  # again: it grows old
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
    """Return once every gauge's quality is ok; asks once per setpoint."""
    for _ in setpoints:
        if all(gauge["quality"] == "ok" for gauge in observer.status()["gauges"]):
            return


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
