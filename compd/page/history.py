"""The last hour of the machine, shown to a page that opens now."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.page.cadence import Cadence
from compd.page.scene import moved_um
from compd.setpoint_states import state_named

Message = Mapping[str, Any]

# Rates (Hz) and durations (s): one row a second for an hour, ten for the last minute.
COARSE_S, COARSE_HZ = 3600.0, 1.0
FINE_S, FINE_HZ = 60.0, 10.0
# Stands for a state's code.
UNKNOWN_STATE = -1.0


class Ring:
    """The newest rows of a table of numbers, one every `1 / rate_hz` seconds."""

    def __init__(self, span_s: float, rate_hz: float, columns: int, dtype: type = np.float32) -> None:
        rows = round(span_s * rate_hz)
        self._cadence = Cadence(rate_hz)
        self._rows: NDArray[Any] = np.full((rows, columns), np.nan, dtype=dtype)
        self._times_s = np.full(rows, np.nan)
        self._count = 0

    def is_due(self, time_s: float) -> bool:
        """Whether a row is due at `time_s` (s)."""
        return self._cadence.is_due(time_s)

    def put(self, time_s: float, row: Sequence[float]) -> None:
        """Replace the oldest row by one of `time_s` (s)."""
        self._cadence.kept(time_s)
        place = self._count % len(self._times_s)
        self._times_s[place], self._rows[place] = time_s, row
        self._count += 1

    def table(self) -> tuple[FloatArray, FloatArray]:
        """Times (N,) and rows (N, columns), the oldest first."""
        kept = min(self._count, len(self._times_s))
        order = (self._count - kept + np.arange(kept)) % len(self._times_s)
        return self._times_s[order], self._rows[order].astype(np.float64)


class History:
    """Numbers of the last hour by the names in `columns`.

    `state` is the state's code; every number is nan while the daemon was not there, and all but the state are while the
    setpoint was not valid.
    """

    def __init__(self, links: int) -> None:
        self.columns = (
            "state",
            *(f"correction_{k}_um" for k in range(1, links + 1)),
            *("tip_x_mm", "tip_y_mm", "tip_z_mm"),
            *("moved_x_um", "moved_y_um", "moved_z_um"),
        )
        self._coarse = Ring(COARSE_S, COARSE_HZ, len(self.columns))
        self._fine = Ring(FINE_S, FINE_HZ, len(self.columns))

    def note(self, time_s: float, setpoint: Message | None, budget: Message | None) -> None:
        """Take a row at `time_s` (s) if one is due; `setpoint` is None while the daemon is unreachable."""
        due = [ring for ring in (self._coarse, self._fine) if ring.is_due(time_s)]
        if due:
            row = self._row(setpoint, budget)
            for ring in due:
                ring.put(time_s, row)

    def tables(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Times and rows of the hour, `coarse`, and of the last minute, `fine`."""
        return {"coarse": self._coarse.table(), "fine": self._fine.table()}

    def _row(self, setpoint: Message | None, budget: Message | None) -> list[float]:
        row = [math.nan] * len(self.columns)
        if setpoint is None:
            return row
        state = state_named(setpoint["state"])
        row[0] = UNKNOWN_STATE if state is None else float(state.code)
        if setpoint["valid"]:
            row[1:-6] = [value * 1e3 for value in setpoint.get("correction_mm", ())]
            row[-6:-3] = setpoint["tip_M_mm"]
            if budget is not None and "tip_um" in budget:
                row[-3:] = moved_um(budget)
        return row


class Traces:
    """Values of each wired channel in the last hour, one a second."""

    def __init__(self, channels: int) -> None:
        # a length of 500 mm to a nanometre
        self._ring = Ring(COARSE_S, COARSE_HZ, channels, np.float64)

    def note(self, time_s: float, gauges: Sequence[Message]) -> None:
        """Take the gauges of a live event at `time_s` (Unix, s); empty while the daemon is unreachable."""
        if gauges and self._ring.is_due(time_s):
            self._ring.put(time_s, [gauge.get("value", math.nan) for gauge in gauges])

    def minute(self, end_s: float) -> dict[str, Any]:
        """The minute before `end_s`: `times_s`, and `values` of each channel at them, None if there was none."""
        times_s, values = self._ring.table()
        chosen = (times_s > end_s - FINE_S) & (times_s <= end_s)
        columns = values[chosen].T.round(7)
        return {
            "times_s": times_s[chosen].round(1).tolist(),
            "values": [[None if math.isnan(value) else value for value in column] for column in columns.tolist()],
        }
