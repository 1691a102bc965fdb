"""The frame grows with its temperature: a comparator that says otherwise drifts, or the frame has been hit."""

from __future__ import annotations

from collections.abc import Iterator

from compd.live.acquisition.cross_checks.machine_view import Contradiction, MachineView
from compd.operation_settings import FrameVote
from compd.units import UM_PER_MM


class FrameTemperature:
    """Compares each frame distance with its thermal change since its first reading."""

    def __init__(self, settings: FrameVote) -> None:
        self._settings = settings
        self._start: dict[int, tuple[float, float]] = {}

    def look(self, view: MachineView) -> Iterator[Contradiction]:
        settings = self._settings
        temperature = view.quantities.get(settings.temperature)
        if temperature is None:
            return
        for i in view.of_kind("frame"):
            if not view.believed[i]:
                self._start.pop(i, None)
                continue
            wired = view.wired[i]
            value_mm, degC = self._start.setdefault(i, (float(view.value[i]), temperature))
            grown_um = wired.sign * (float(view.value[i]) - value_mm) * UM_PER_MM
            expected_um = settings.expansion_ppm_per_K * 1e-6 * (temperature - degC) * wired.length_mm * UM_PER_MM
            if abs(grown_um - expected_um) > settings.tolerance_um:
                del self._start[i]
                yield Contradiction(
                    i,
                    f"has moved by {grown_um:+.1f} um, {settings.temperature} explains {expected_um:+.1f} um, allowed "
                    f"{settings.tolerance_um:g} um apart",
                )
