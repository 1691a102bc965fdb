"""The two ball shanks of one revolute joint move together, but for the play of its axis."""

from __future__ import annotations

from collections.abc import Iterator

from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView
from compd.units import UM_PER_MM

# Duration (s) of a difference that counts; longer than the interval of two polls of one unit.
LASTING_S = 0.5


class JointPair:
    """Compares Ra with Rb at each link; names the one that has moved further if they differ."""

    def __init__(self, largest_um: float) -> None:
        self._largest_um = largest_um
        self._since_s: dict[int, float] = {}

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        role = {(wired.link, wired.role): i for i, wired in enumerate(view.wired) if wired.kind == "joint"}
        for (link, name), a in role.items():
            b = role.get((link, "Rb"))
            if name != "Ra" or b is None:
                continue
            apart_um = float(view.change[a] - view.change[b]) * UM_PER_MM
            if not (view.believed[a] and view.believed[b]) or not abs(apart_um) > self._largest_um:
                self._since_s.pop(link, None)
            elif view.now_s - self._since_s.setdefault(link, view.now_s) >= LASTING_S:
                del self._since_s[link]
                further, other = (a, b) if abs(view.change[a]) >= abs(view.change[b]) else (b, a)
                yield Contradiction(
                    further,
                    f"is {abs(apart_um):.1f} um from {view.wired[other].meaning} at the same joint, allowed "
                    f"{self._largest_um:g} um",
                )
