"""A daemon that sends what a test says, a hundred times a second."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from typing import Any

from compd.clock import MonotonicClock
from tests.support.bridge_daemon import BridgeDaemon

PERIOD_S, VALID_S = 0.01, 0.1


class SetpointSender:
    """Setpoints, a hundred a second, to one bridge."""

    def __init__(self, path: Path) -> None:
        """path : of the Unix socket. correction_mm : what is asked for; None for setpoints that are not valid.
        frame : as in a SETPOINT."""
        self.correction_mm: list[float] | None = [0.0] * 6
        self.frame = {name: [0.0] * 3 for name in ("origin_M_mm", "displacement_M_mm", "rotation_M_rad")}
        self._daemon = BridgeDaemon(path)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="setpoints", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._end.set()
        self._thread.join()
        self._daemon.close()

    def _run(self) -> None:
        self._daemon.greet()
        clock, seq = MonotonicClock(), 0
        while not clock.wait(self._end, PERIOD_S):
            seq, now_s = seq + 1, time.monotonic()
            message: dict[str, Any] = {"class": "SETPOINT", "seq": seq, "time_s": now_s, "valid_until": now_s + VALID_S}
            if self.correction_mm is None:
                message |= {"valid": False, "state": "stop", "valid_until": now_s}
            else:
                message |= {"valid": True, "state": "ok", "correction_mm": self.correction_mm, "frame": self.frame}
            try:
                self._daemon.send_message(message)
            except OSError:
                return  # LinuxCNC has ended
