"""The room: air temperature, pressure and humidity as functions of time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

# ISO 1: a graduation, and the tables of an interferometer, are true at this temperature.
REFERENCE_degC = 20.0
STANDARD_PRESSURE_hPa = 1013.25  # ISO 2533, sea level
MIDDLE_HUMIDITY_pct = 50.0


class AirAtZero(NamedTuple):
    """The air when machine zero is taken, at time 0; machine and parts have its temperature then."""

    temperature_degC: float = REFERENCE_degC
    pressure_hPa: float = STANDARD_PRESSURE_hPa
    humidity_pct: float = MIDDLE_HUMIDITY_pct


STANDARD_AIR = AirAtZero()

# Period in s and share of the daily swing: the day, a shift, the air conditioning's own cycle.
_TEMPERATURE_WAVES = ((86400.0, 1.0), (9000.0, 0.35), (1300.0, 0.12))
# A front passes in two or three days; within a day the pressure tide is 1 hPa.
_PRESSURE_WAVES_hPa = ((200000.0, 8.0), (43200.0, 1.0))
_HUMIDITY_WAVES_pct = ((86400.0, 6.0), (14400.0, 2.0))

# A workshop without air conditioning (VDI/VDE 2627, class 5): K, hPa, pct, between sessions and within one.
ROOM_LEVEL = np.array([2.0, 8.0, 8.0])
ROOM_WANDERS = np.array([1.5, 2.0, 4.0])
KNOTS_PER_SESSION = 4


class Weather:
    """An air-conditioned laboratory: sums of slow waves with seeded phases.

    at_zero : at time 0.
    controlled : values held by a climate chamber, by name with unit; they replace the waves.
    """

    def __init__(self, swing_K: float, rng: np.random.Generator, at_zero: AirAtZero = STANDARD_AIR) -> None:
        """swing_K : amplitude of the daily wave of the room's temperature."""
        self.at_zero = at_zero
        self.controlled: Mapping[str, float] = {}
        self._temperature = _phased([(period, share * swing_K) for period, share in _TEMPERATURE_WAVES], rng)
        self._pressure = _phased(_PRESSURE_WAVES_hPa, rng)
        self._humidity = _phased(_HUMIDITY_WAVES_pct, rng)

    def room_degC(self, time_s: float) -> float:
        return self.controlled.get("temperature_room_degC", self.at_zero.temperature_degC + self._room_K(time_s))

    def pressure_hPa(self, time_s: float) -> float:
        return self.controlled.get("pressure_hPa", self.at_zero.pressure_hPa + self._over_zero_hPa(time_s))

    def humidity_pct(self, time_s: float) -> float:
        return self.controlled.get("humidity_pct", self.at_zero.humidity_pct + self._over_zero_pct(time_s))

    # --- departures from time 0 -----------------------------------------------------------------------

    def _room_K(self, time_s: float) -> float:
        return _waves(self._temperature, time_s)

    def _over_zero_hPa(self, time_s: float) -> float:
        return _waves(self._pressure, time_s)

    def _over_zero_pct(self, time_s: float) -> float:
        return _waves(self._humidity, time_s)


_Waves = list[tuple[float, float, float]]


def _phased(waves: list[tuple[float, float]] | tuple[tuple[float, float], ...], rng: np.random.Generator) -> _Waves:
    return [(2 * math.pi / period, amplitude, rng.uniform(0, 2 * math.pi)) for period, amplitude in waves]


def _waves(waves: _Waves, time_s: float) -> float:
    return sum(a * (math.sin(w * time_s + phase) - math.sin(phase)) for w, a, phase in waves)


class WorkshopWeather(Weather):
    """A workshop over days: room, pressure and humidity interpolated linearly between random values.

    Each session has a level of its own with random departures around it.
    """

    def __init__(
        self, starts_s: list[float], session_s: float, rng: np.random.Generator, at_zero: AirAtZero = STANDARD_AIR
    ) -> None:
        """starts_s : start of each session; between sessions the room changes to the next one's level."""
        super().__init__(0.0, rng, at_zero)
        knots: list[tuple[float, float, float, float]] = [(0.0, 0.0, 0.0, 0.0)]
        for number, start_s in enumerate(starts_s):
            level = rng.uniform(-1.0, 1.0, 3) * ROOM_LEVEL if number else np.zeros(3)
            for k in range(KNOTS_PER_SESSION + 1):
                time_s = start_s + k * session_s / KNOTS_PER_SESSION
                if time_s > knots[-1][0]:
                    room_K, pressure_hPa, humidity_pct = level + rng.uniform(-1.0, 1.0, 3) * ROOM_WANDERS
                    knots.append((time_s, room_K, pressure_hPa, humidity_pct))
        self._times_s = [time_s for time_s, *_ in knots]
        self._knots = [(float(room_K), float(hPa), float(pct)) for _, room_K, hPa, pct in knots]

    def _room_K(self, time_s: float) -> float:
        return self._at(0, time_s)

    def _over_zero_hPa(self, time_s: float) -> float:
        return self._at(1, time_s)

    def _over_zero_pct(self, time_s: float) -> float:
        return self._at(2, time_s)

    def _at(self, value: int, time_s: float) -> float:
        """A value of the knots between two of them, or of the first or last one beyond."""
        after = bisect_right(self._times_s, time_s)
        if after in (0, len(self._times_s)):
            return self._knots[max(after - 1, 0)][value]
        start_s, end_s = self._times_s[after - 1], self._times_s[after]
        start, end = self._knots[after - 1][value], self._knots[after][value]
        return (end - start) / (end_s - start_s) * (time_s - start_s) + start
