"""The READINGS message: everything that one cycle computed from, as a line of JSON that is read back bit for bit.

A message stands on its own: it has the cycle's readings, machine zero and target, and the state that the cycle had
from the one before it. So any subset of a run can be replayed, however few of its cycles were recorded. Numbers are
written in full (the shortest text that reads back as the same float64), while those of a SETPOINT are rounded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from compd.columns import frame_columns, joint_columns, scale_columns
from compd.errors import Problem, StateError
from compd.gauge import Quality, Reading, ReadingMotion
from compd.live.loop import CycleInputs, CycleState, SentCycle, Target, setpoint_line, with_zero_of
from compd.live.machine import MachineWires, MachineZero
from compd.live.memory import Readings, Snapshot
from compd.live.service.messages import line
from compd.live.service.state_json import from_plain, to_plain
from compd.text import omit_unknown


class RecordedCycle(NamedTuple):
    """A READINGS message read back.

    The models are None in both: the message has their hashes only.
    """

    state: CycleState  #: the state that the cycle had from the one before it
    inputs: CycleInputs  #: what the cycle computed from
    setpoint_line: bytes  #: the SETPOINT line that it made, with its newline


class ReadingsMessage:
    """Makes the READINGS messages of a machine, and the `columns` that describe them in the answer to WATCH."""

    def __init__(
        self,
        wires: MachineWires,
        channels: Sequence[str],
        model_columns: Sequence[str] = (),
        rotation_B0_in_M_rad: Sequence[float] = (),
    ) -> None:
        """channels : names of a snapshot's readings, in order.

        model_columns : of a recording, that are made of setpoints: the pose that own kinematics or a client gives and
        what its class gives beside it, or the one that the controller of a machine without scales is told.
        rotation_B0_in_M_rad : (3,), where these columns need it.
        """
        self.from_setpoints: dict[str, list[str] | list[float]] = {}
        if model_columns:
            self.from_setpoints["model_columns"] = list(model_columns)
        if rotation_B0_in_M_rad:
            self.from_setpoints["rotation_B0_in_M_rad"] = list(rotation_B0_in_M_rad)
        self.columns = columns(wires)
        self._channels = tuple(channels)

    def line(self, cycle: SentCycle) -> bytes:
        """The READINGS line of a cycle, with its newline."""
        inputs, state = cycle.inputs, cycle.state_before
        message: dict[str, Any] = {
            "class": "READINGS",
            "seq": inputs.tick,
            "time_s": inputs.snapshot.time_s,
            "readings": dict(zip(self._channels, map(_reading, inputs.snapshot.readings), strict=True)),
        }
        if cycle.approach:
            message["approach"] = cycle.approach
        if isinstance(inputs.zero, MachineZero):
            message["zero"] = inputs.zero.to_json()
        else:
            problem = inputs.zero.problems[0]
            message["no_zero"] = {"where": problem.where, "what": problem.what, "next_step": problem.next_step}
        if inputs.target is not None:
            message["target"] = _known(vars(inputs.target))
        if inputs.ending:
            message["ending"] = inputs.ending
        message |= cycle.models.hashes
        if cycle.models.files:
            message["model_files"] = cycle.models.files
        message["carried"] = to_plain(state._replace(zero=None)) | {"zero": state.zero is inputs.zero}
        return line(message)[:-2] + b',"setpoint":' + cycle.setpoint_line[:-1] + b"}\n"


def columns(wires: MachineWires) -> list[dict[str, Any]]:
    """Which channel is which column of a recording, for the answer to WATCH.

    A length's column is sign * (reading - machine zero), in the unit at the end of its name. Any other quantity has no
    sign here and is recorded as it is read.
    """
    names = [*scale_columns(len(wires.scale.wires)), *joint_columns(wires.joints)]
    names += frame_columns(len(wires.frame.wires))
    lengths: list[dict[str, Any]] = [
        {"column": name, "channel": wire.channel, "sign": wire.sign, "stale_after_s": wire.stale_after_s}
        for name, wire in zip(names, wires.length_wires, strict=True)
    ]
    return lengths + [
        {"column": wire.meaning, "channel": wire.channel, "stale_after_s": wire.stale_after_s}
        for wire in wires.all_wires[len(names) :]
    ]


def parse_readings(message: Mapping[str, Any], channels: Sequence[str]) -> RecordedCycle:
    """The cycle behind a READINGS message, with its readings in the order of `channels`.

    Raises KeyError, TypeError or ValueError for anything that is not such a message.
    """
    readings = Readings.of(_parsed_reading(message["readings"][channel]) for channel in channels)
    zero = MachineZero(**message["zero"]) if "zero" in message else StateError(Problem(**message["no_zero"]))
    target = message.get("target")
    inputs = CycleInputs(
        message["seq"],
        Snapshot(message["time_s"], readings),
        zero,
        None if target is None else Target(**{key: from_plain(part) for key, part in target.items()}),
        ending=message.get("ending", ""),
    )
    # up to 0.3.0 a bound of the tip's error that was not known was null
    sent = setpoint_line(omit_unknown(message["setpoint"]))
    return RecordedCycle(with_zero_of(from_plain(message["carried"]), zero), inputs, sent)


def _known(fields: Mapping[str, Any]) -> dict[str, Any]:
    """The fields that are known; `omit_unknown` takes ten times as long, since it looks into every part."""
    return {
        name: part
        for name, part in fields.items()
        if part is not None and not (isinstance(part, float) and not math.isfinite(part))
    }


def _reading(reading: Reading) -> dict[str, Any]:
    """A reading as plain data: its value, or why there is none."""
    value, time_s, quality, detail, motion = reading
    if quality is Quality.OK:
        good = {"value": value, "time_s": time_s}
        return good if motion is None else good | {"motion": _known(motion._asdict())}
    fault = {"quality": quality, "time_s": time_s}
    return fault | {"detail": detail} if detail else fault


def _parsed_reading(data: Mapping[str, Any]) -> Reading:
    quality = Quality(data.get("quality", Quality.OK))
    motion = data.get("motion")
    return Reading(
        data.get("value", math.nan),
        data["time_s"],
        quality,
        data.get("detail", ""),
        None if motion is None else ReadingMotion(**motion),
    )
