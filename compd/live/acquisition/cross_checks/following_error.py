"""Machine-tool mode: a scale off its setpoint for longer than a controller lags."""

from __future__ import annotations

from collections.abc import Iterator

from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView

# Duration (s) of a deviation that counts; longer than a controller takes to follow a step.
LASTING_S = 1.0


class FollowingError:
    """Compares the scales with the sent setpoints."""

    def __init__(self, largest_mm: float) -> None:
        self._largest_mm = largest_mm
        self._since_s: dict[int, float] = {}

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        setpoint = view.setpoint
        if setpoint is None or setpoint["mode"] != "machine_tool" or not setpoint["valid"]:
            self._since_s.clear()
            return
        for i in view.of_kind("scale"):
            off_mm = float(view.change[i]) - setpoint["scale_setpoint_mm"][view.wired[i].link - 1]
            if not view.believed[i] or not abs(off_mm) > self._largest_mm:
                self._since_s.pop(i, None)
            elif view.now_s - self._since_s.setdefault(i, view.now_s) >= LASTING_S:
                del self._since_s[i]
                yield Contradiction(i, f"is {off_mm:+.3f} mm from its setpoint, allowed {self._largest_mm:g} mm")
