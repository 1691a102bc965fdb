"""The rows of a recording's table, made of the daemon's messages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scipy.spatial.transform import Rotation

from compd.columns import MODEL_COLUMNS, SKEW_COLUMN, approach_columns, decimals
from compd.live.record.part_table import Row
from compd.setpoint_states import Mode
from compd.units import UM_PER_MM

Message = Mapping[str, Any]


class TableRows:
    """The rows of one part."""

    def __init__(self, watch: Message, first_readings: Message, origin_s: float) -> None:
        """`watch`: the daemon's answer to WATCH. `first_readings`: the first READINGS of the part. `origin_s`:
        monotonic time that is 0 in the column time_s."""
        self._columns: Sequence[Message] = watch["columns"]
        self._zero: Message = first_readings["zero"]
        self._origin_s = origin_s
        self._links = len(first_readings.get("approach", ()))
        of_gauges = ["time_s", *(column["column"] for column in self._columns), SKEW_COLUMN]
        self._decimals = {name: decimals(name) for name in of_gauges}
        self._model: Sequence[str] = watch.get("model_columns", ())
        self._rotation_B0_rad: Sequence[float] | None = watch.get("rotation_B0_in_M_rad")
        self._decimals |= {name: decimals(name) for name in self._model}
        self.names = [*of_gauges, *approach_columns(self._links), *self._model]  #: of the columns
        #: those that are written with every digit
        self.in_full = {column["column"] for column in self._columns if "sign" not in column}

    def row(self, message: Message) -> Row:
        """The row of a READINGS message."""
        now_s, readings = message["time_s"], message["readings"]
        row: list[float | None] = [self._number("time_s", now_s - self._origin_s)]
        row += [self._value(column, readings[column["channel"]], now_s) for column in self._columns]
        row += [self._number(SKEW_COLUMN, message["setpoint"]["skew_s"]) if "skew_s" in message["setpoint"] else None]
        # None until a link has moved
        row += [float(direction) if direction else None for direction in message.get("approach", ())[: self._links]]
        if self._model:
            row += self._pose(message["setpoint"])
        return row

    def _pose(self, setpoint: Message) -> list[float | None]:
        """The tip before any correction, and what the class gives; without scales the pose that the controller is told.

        None where the setpoint is not valid.
        """
        if not setpoint["valid"]:
            return [None] * len(self._model)
        if self._rotation_B0_rad is not None:
            return self._told(setpoint, self._rotation_B0_rad)
        tip_mm = setpoint["tip_M_mm"]
        if setpoint["mode"] == Mode.CMM:
            tip_mm = [tip + undone for tip, undone in zip(tip_mm, setpoint["tip_correction_mm"], strict=True)]
        known = {**dict(zip(MODEL_COLUMNS, tip_mm, strict=True)), **setpoint.get("own_columns", {})}
        return [self._number(name, known[name]) if name in known else None for name in self._model]

    def _told(self, setpoint: Message, rotation_B0_in_M_rad: Sequence[float]) -> list[float | None]:
        """The target with its correction, in {B0}."""
        told = [tip + more for tip, more in zip(setpoint["tip_B0_mm"], setpoint["tip_correction_mm"], strict=True)]
        attitude = Rotation.from_rotvec(rotation_B0_in_M_rad).inv() * Rotation.from_rotvec(setpoint["rotation_M_rad"])
        told += (Rotation.from_rotvec(setpoint["rotation_correction_rad"]) * attitude).as_rotvec().tolist()
        return [self._number(name, value) for name, value in zip(self._model, told, strict=False)]

    def _value(self, column: Message, reading: Message, now_s: float) -> float | None:
        """None where the reading is not good, or too old for the daemon to use."""
        if "value" not in reading or now_s - reading["time_s"] > column["stale_after_s"]:
            return None
        value: float = reading["value"]
        name = column["column"]
        if "sign" not in column:
            return value
        change_mm = column["sign"] * (value - self._zero["readings_mm"][column["channel"]])
        return self._number(name, change_mm * UM_PER_MM if name.endswith("_um") else change_mm)

    def _number(self, column: str, value: float) -> float:
        """`value` with the decimals of its column; -0 is 0."""
        places = self._decimals[column]
        return (value if places is None else round(value, places)) + 0.0
