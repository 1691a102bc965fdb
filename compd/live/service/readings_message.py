"""READINGS: everything that one cycle computed from, as a line of JSON, and back without losing a bit.

A message stands on its own: it has the cycle's readings, machine zero and target, and what the cycle had from
the one before it. So any subset of a run can be replayed, however thinly it was recorded. Numbers are written
in full (the shortest text that reads back as the same float64), where a SETPOINT is rounded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from compd.errors import Problem, StateError
from compd.gauge import Quality, Reading
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleInputs, CycleState
from compd.live.loop.directions import Directions
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.wiring import MachineWires
from compd.live.service.messages import line
from compd.live.service.state_json import from_plain, to_plain
from compd.readings import Snapshot
from compd.recording.columns import FRAME_COLUMNS, joint_columns, scale_columns


class RecordedCycle(NamedTuple):
    """One READINGS message: the tick, what went in, and the SETPOINT line that came out."""

    tick: int
    inputs: CycleInputs
    setpoint_line: bytes


class ReadingsMessage:
    """Writes a machine's READINGS; `wires` and `channels`: of the loop's snapshots, which `directions` sees."""

    def __init__(self, wires: MachineWires, channels: Sequence[str], directions: Directions) -> None:
        self.columns = columns(wires)
        self._channels = tuple(channels)
        self._directions = directions

    def line(self, setpoint: Setpoint) -> bytes:
        """The READINGS line of the cycle that made `setpoint`, with its newline."""
        inputs = setpoint.inputs
        assert inputs is not None, "every setpoint of a cycle has its inputs"
        message: dict[str, Any] = {
            "class": "READINGS",
            "seq": setpoint.seq,
            "time_s": inputs.snapshot.time_s,
            "readings": dict(zip(self._channels, map(_reading, inputs.snapshot.readings), strict=True)),
        }
        if approach := self._directions.now:
            message["approach"] = approach
        if isinstance(inputs.zero, MachineZero):
            message["zero"] = inputs.zero.to_json()
        else:
            problem = inputs.zero.problems[0]
            message["no_zero"] = {"where": problem.where, "what": problem.what, "next_step": problem.next_step}
        if inputs.target is not None:
            message["target"] = _target(inputs.target)
        if inputs.models is not None:
            message |= inputs.models.hashes
            if files := inputs.models.files:
                message["model_files"] = files
        message["carried"] = _carried(inputs)
        return line(message)[:-2] + b',"setpoint":' + setpoint.to_json()[:-1] + b"}\n"


def columns(wires: MachineWires) -> list[dict[str, Any]]:
    """Which channel is which column of a recording, for the answer to WATCH.

    A length's column is sign * (reading - machine zero), in the unit at the end of its name; a quantity, which has
    no sign here, is recorded as it is read.
    """
    names = [*scale_columns(len(wires.scale.wires)), *joint_columns(wires.joints), *FRAME_COLUMNS]
    found: list[dict[str, Any]] = [
        {"column": name, "channel": wire.channel, "sign": wire.sign, "stale_after_s": wire.stale_after_s}
        for name, wire in zip(names, wires.length_wires, strict=True)
    ]
    quantities = wires.all_wires[len(names) :]
    return found + [
        {"column": wire.meaning, "channel": wire.channel, "stale_after_s": wire.stale_after_s} for wire in quantities
    ]


def parse_readings(message: Mapping[str, Any], channels: Sequence[str]) -> RecordedCycle:
    """The cycle behind a READINGS message; its readings in the order of `channels`.

    Raises KeyError, TypeError or ValueError for what is no such message.
    """
    readings = tuple(_parsed_reading(message["readings"][channel]) for channel in channels)
    zero = MachineZero(**message["zero"]) if "zero" in message else StateError(Problem(**message["no_zero"]))
    target = message.get("target")
    inputs = CycleInputs(
        Snapshot(message["time_s"], readings),
        zero,
        None if target is None else Target(**{key: tuple(value) for key, value in target.items()}),
        _parsed_carried(message["carried"], zero),
    )
    return RecordedCycle(message["seq"], inputs, line(message["setpoint"]))


def _reading(reading: Reading) -> dict[str, Any]:
    """A value, or why there is none."""
    value, time_s, quality, detail = reading
    if quality is Quality.OK:
        return {"value": value, "time_s": time_s}
    found = {"quality": quality, "time_s": time_s}
    return found | {"detail": detail} if detail else found


def _parsed_reading(data: Mapping[str, Any]) -> Reading:
    quality = Quality(data.get("quality", Quality.OK))
    return Reading(data.get("value", math.nan), data["time_s"], quality, data.get("detail", ""))


def _target(target: Target) -> dict[str, Any]:
    found: dict[str, Any] = {"tip_mm": target.tip_mm}
    if target.rotation_B0_rad is not None:
        found["rotation_B0_rad"] = target.rotation_B0_rad
    return found


def _carried(inputs: CycleInputs) -> Any:
    """What was carried over; of its zero only whether it is this cycle's, since of another nothing is used."""
    carried = inputs.carried
    return to_plain(carried._replace(zero=None)) | {"zero": carried.zero is inputs.zero}


def _parsed_carried(data: Mapping[str, Any], zero: MachineZero | StateError) -> CycleState:
    carried: CycleState = from_plain(data)
    return carried._replace(zero=zero if carried.zero and isinstance(zero, MachineZero) else None)
