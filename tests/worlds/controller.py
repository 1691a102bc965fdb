"""A controller in machine-tool mode: it sends targets, and drives the links to the setpoints that come back."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from compd.configuration import Configuration
from tests.worlds.clients import AGAIN_S
from tests.worlds.connection import Connection
from tests.worlds.virtual_system import VirtualSystem

# Targets per second.
RATE_HZ = 50.0


class Controller:
    """Follows a straight way from target to target at constant speed, as long as it is `on`.

    Attributes
    ----------
    turn : number of its turns as the machine's controller; 0 while it is none. tip_mm : (3) where the tip is to be, in
        {M}, or in {P} of a machine whose tool is on the plate; nan before the first target.
    target_s : time of the newest target that was sent, s; -inf before the first.
    """

    def __init__(
        self, system: VirtualSystem, configuration: Configuration, drive: Callable[[np.ndarray], object]
    ) -> None:
        """`drive`: begins to drive the links to their setpoints, (n) mm."""
        base = configuration.geometry.base
        self.turn = self._turns = 0
        self.target_s = -math.inf
        self.tip_mm = np.full(3, np.nan)
        self._origin_mm = np.array(base.origin_B0_in_M_mm)
        self._rotation = Rotation.from_rotvec(base.rotation_B0_in_M_rad)
        self._on_plate = configuration.geometry.tool.on == "plate"
        self._system = system
        self._path = Path(configuration.sockets.unix.path)
        self._drive = drive
        self._goal_mm = self.tip_mm
        self._mm_per_s = 50.0
        self._silent_until_s = self._old_until_s = self._exchanged_until_s = 0.0
        self._exchanged = (0, 0)
        self._last: dict[str, Any] = {}

    @property
    def on(self) -> bool:
        """Whether it is the machine's controller."""
        return self.turn > 0

    def begin(self, tip_mm: np.ndarray) -> int:
        """Take the machine over, with the tip where it is. Returns the number of this turn."""
        self.tip_mm = self._goal_mm = np.array(tip_mm)
        self._turns += 1
        self.turn, self._last = self._turns, {}
        self._system.start(partial(self._run, self.turn), "client controller")
        return self.turn

    def go(self, tip_mm: np.ndarray, mm_per_s: float) -> None:
        """Go to another place."""
        self._goal_mm, self._mm_per_s = np.array(tip_mm), mm_per_s

    def end(self) -> None:
        """Leave the machine to itself: the mode is CMM again."""
        self.turn = 0

    # --- faults ----------------------------------------------------------------------------------------

    def silent(self, duration_s: float) -> None:
        """Send no target for so long, after the first."""
        self._silent_until_s = self._system.monotonic() + duration_s

    def old(self, duration_s: float) -> None:
        """Repeat the last target, with its time, for so long; the machine goes on."""
        self._old_until_s = self._system.monotonic() + duration_s

    def exchanged(self, a: int, b: int, duration_s: float) -> None:
        """Take the setpoint of link `a` for that of link `b`, counted from 1, for so long."""
        self._exchanged_until_s, self._exchanged = self._system.monotonic() + duration_s, (a - 1, b - 1)

    # --- as an actor -----------------------------------------------------------------------------------

    def _run(self, turn: int) -> None:
        while self.turn == turn:
            with suppress(OSError):
                self._control(turn)
            self._system.sleep_until(self._system.monotonic() + AGAIN_S)

    def _control(self, turn: int) -> None:
        system, period_s = self._system, 1.0 / RATE_HZ
        with Connection(system, self._path) as connection:
            connection.send({"class": "WATCH", "rate_hz": RATE_HZ})
            due_s = system.monotonic()
            while self.turn == turn:
                if system.monotonic() >= due_s:
                    due_s += period_s
                    self._advance(period_s)
                    if system.monotonic() >= self._silent_until_s or not self._last:
                        target = self._target()
                        connection.send(target)
                        self.target_s = target["time_s"]
                if (line := connection.line(due_s)) and self.turn == turn:
                    self._take(json.loads(line))

    def _advance(self, time_s: float) -> None:
        way_mm = self._goal_mm - self.tip_mm
        left_mm = float(np.linalg.norm(way_mm))
        step_mm = self._mm_per_s * time_s
        self.tip_mm = self._goal_mm if left_mm <= step_mm else self.tip_mm + way_mm * (step_mm / left_mm)

    def _target(self) -> dict[str, Any]:
        now_s = self._system.monotonic()
        if now_s >= self._old_until_s or not self._last:
            tip_mm = self.tip_mm if self._on_plate else self._rotation.inv().apply(self.tip_mm - self._origin_mm)
            key = "tip_P_mm" if self._on_plate else "tip_B0_mm"
            self._last = {"class": "TARGET", key: tip_mm.tolist(), "time_s": now_s}
        return self._last

    def _take(self, message: dict[str, Any]) -> None:
        if message.get("code") == "role_taken":  # a person has done so
            self.end()
        if message["class"] != "SETPOINT" or not message["valid"] or message["mode"] != "machine_tool":
            return
        scale_mm = np.array(message["scale_setpoint_mm"])
        if self._system.monotonic() < self._exchanged_until_s:
            a, b = self._exchanged
            scale_mm[[a, b]] = scale_mm[[b, a]]
        self._drive(scale_mm)
