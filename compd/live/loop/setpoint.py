"""A setpoint: what one cycle found, as a line of JSON and as one fixed-size packet."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Mapping
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.json_text import encode_compact

if TYPE_CHECKING:
    from compd.live.loop.cycle_state import CycleInputs


class State(StrEnum):
    """How a setpoint came about. The order gives the state's code in the packet: append, never reorder."""

    STARTING = "starting"  # not every gauge has been read yet
    NO_ZERO = "no_zero"  # no machine zero fits this configuration: take one
    OK = "ok"
    SLEWING = "slewing"  # the correction is on its way, at the slew limit
    CLAMPED = "clamped"  # the correction is held at its limit
    HOLD = "hold"  # a comparator is lost: the last good set is used
    FADE = "fade"  # a comparator is lost: the last good set is taken back to zero
    STOP = "stop"  # a gauge is lost and nothing replaces it
    REFUSED = "refused"  # beyond a limit, unreachable, or not finite


class Mode(StrEnum):
    """Who gives the tip: the scales (cmm) or a controller's target (machine_tool)."""

    CMM = "cmm"
    MACHINE_TOOL = "machine_tool"


STATE_CODES: Mapping[State, int] = {state: code for code, state in enumerate(State)}
MODE_CODES: Mapping[Mode, int] = {mode: code for code, mode in enumerate(Mode)}

# 0.1 pm would be noise; 0.1 nm is a hundredth of the best comparator's step.
_DECIMALS_MM = 7
# 0.1 nrad on a 1 m lever is 0.1 nm.
_DECIMALS_RAD = 10
_DECIMALS_S = 6
# An uncertainty is known to two digits.
_DECIMALS_UM = 4

# magic, version, size, seq, time, valid_until, age, flags, state, mode, links, 3 spare bytes, tip 3, frame
# displacement 3, frame rotation 3, then link length, scale setpoint and correction for 6 links, configuration hash;
# a CRC-32 follows. README.md gives every offset.
_PACKET = struct.Struct("<4sHHQdddHBBB3x3d3d3d6d6d6d8s")
_MAGIC = b"CMPD"
_VERSION = 1
_FLAG_VALID = 1
_FLAG_TOOL_ON_PLATE = 2  # the tip's three numbers are then tip_P
PACKET_SIZE = _PACKET.size + 4
_LINKS = 6
_NO_NUMBERS = (math.nan,) * (9 + 3 * _LINKS)


class ShadowResult(NamedTuple):
    """What a model that is not applied asks for in the same cycle.

    model : hash of its file.  reason : why it has no numbers; "" when it has.
    correction_mm (n) before limits, tip_M_mm (3); tip_P_mm (3) with the tool on the plate.
    """

    model: str
    reason: str
    correction_mm: FloatArray | None = None
    tip_M_mm: FloatArray | None = None
    tip_P_mm: FloatArray | None = None


class SetpointValues(NamedTuple):
    """What a valid setpoint says; n links.

    tip_M_mm (3), tip_B0_mm (3): the tool tip in {M} and, equation (9), in {B0}; with the tool on the plate
    instead tip_P_mm (3), the touched place on the work. frame_origin_M_mm (3): origin of {B}.
    frame_displacement_M_mm (3), frame_rotation_M_rad (3): displacement and rotation vector of {B} since machine zero.
    link_length_mm, scale_setpoint_mm, correction_mm (n): the correction is what is added to the command,
    after its limits. sources_mm: how much joints, frame and each effect ask for, before the limits.
    u_tip_um (3): standard uncertainty of the tip in {M}, with the tool on the plate of the place in {P}; None unknown.
    shadow: what another model asks for.
    """

    tip_M_mm: FloatArray
    tip_B0_mm: FloatArray
    tip_P_mm: FloatArray | None
    frame_origin_M_mm: FloatArray
    frame_displacement_M_mm: FloatArray
    frame_rotation_M_rad: FloatArray
    link_length_mm: FloatArray
    scale_setpoint_mm: FloatArray
    correction_mm: FloatArray
    sources_mm: Mapping[str, FloatArray]
    u_tip_um: FloatArray | None = None
    shadow: ShadowResult | None = None


class Setpoint(NamedTuple):
    """One cycle's result.

    seq : counts cycles, also invalid ones; a gap is a missed cycle or a dropped message.
    time_s, valid_until_s : monotonic seconds; an invalid setpoint has expired when it is made.
    age_s : of the oldest gauge used; nan where none was.
    reason : why the state is not ok; "" when it is.
    numbers : None unless valid, so that no number looks alive that is not.
    inputs : what it was computed from, for whoever watches the readings; no part of a SETPOINT message.
    model : hash of the model file that was applied; "" without effects.
    """

    seq: int
    time_s: float
    valid_until_s: float
    age_s: float
    state: State
    reason: str
    mode: Mode
    numbers: SetpointValues | None
    inputs: CycleInputs | None = None
    model: str = ""

    @property
    def valid(self) -> bool:
        return self.numbers is not None

    def to_json(self) -> bytes:
        """One line, with its newline. What does not exist is left out; there is no null and no NaN."""
        message: dict[str, Any] = {
            "class": "SETPOINT",
            "seq": self.seq,
            "time_s": round(self.time_s, _DECIMALS_S),
            "valid": self.valid,
            "state": self.state,
            "reason": self.reason,
            "valid_until": round(self.valid_until_s, _DECIMALS_S),
            "mode": self.mode,
        }
        if self.model:
            message["model"] = self.model
        if math.isfinite(self.age_s):
            message["age_s"] = round(self.age_s, _DECIMALS_S)
        if self.numbers is not None:
            message |= _plain(self.numbers)
        return encode_compact(message).encode() + b"\n"

    def to_packet(self, config_hash: bytes) -> bytes:
        """`PACKET_SIZE` bytes, little-endian; the links a machine does not have are nan.

        config_hash : the first 8 bytes of the configuration's hash.
        """
        numbers = self.numbers
        values: tuple[float, ...] = _NO_NUMBERS
        links = flags = 0
        if numbers is not None:
            links = len(numbers.correction_mm)
            flags = _FLAG_VALID if numbers.tip_P_mm is None else _FLAG_VALID | _FLAG_TOOL_ON_PLATE
            unused = (math.nan,) * (_LINKS - links)
            values = (
                *(numbers.tip_M_mm if numbers.tip_P_mm is None else numbers.tip_P_mm).tolist(),
                *numbers.frame_displacement_M_mm.tolist(),
                *numbers.frame_rotation_M_rad.tolist(),
                *numbers.link_length_mm.tolist(),
                *unused,
                *numbers.scale_setpoint_mm.tolist(),
                *unused,
                *numbers.correction_mm.tolist(),
                *unused,
            )
        body = _PACKET.pack(
            _MAGIC,
            _VERSION,
            PACKET_SIZE,
            self.seq,
            self.time_s,
            self.valid_until_s,
            self.age_s,
            flags,
            STATE_CODES[self.state],
            MODE_CODES[self.mode],
            links,
            *values,
            config_hash,
        )
        return body + zlib.crc32(body).to_bytes(4, "little")


def _plain(numbers: SetpointValues) -> dict[str, Any]:
    """The numbers as lists, rounded: vectors of a machine without a tool on the plate have no tip_P_mm."""
    lengths = {
        "tip_M_mm": numbers.tip_M_mm,
        "tip_B0_mm": numbers.tip_B0_mm,
        "link_length_mm": numbers.link_length_mm,
        "scale_setpoint_mm": numbers.scale_setpoint_mm,
        "correction_mm": numbers.correction_mm,
    }
    if numbers.tip_P_mm is not None:
        lengths["tip_P_mm"] = numbers.tip_P_mm
    frame = {"origin_M_mm": numbers.frame_origin_M_mm, "displacement_M_mm": numbers.frame_displacement_M_mm}
    # one call on one long array costs what one call on three numbers does
    plain = _rounded([*lengths.values(), *frame.values(), *numbers.sources_mm.values()])
    return _known(numbers) | {
        **dict(zip(lengths, plain, strict=False)),
        "frame": {
            **dict(zip(frame, plain, strict=False)),
            "rotation_M_rad": numbers.frame_rotation_M_rad.round(_DECIMALS_RAD).tolist(),
        },
        "sources_mm": dict(zip(numbers.sources_mm, plain, strict=True)),
    }


def _known(numbers: SetpointValues) -> dict[str, Any]:
    """What not every machine has: the uncertainty, another model's correction."""
    found: dict[str, Any] = {}
    if numbers.u_tip_um is not None and math.isfinite(numbers.u_tip_um.sum()):
        found["u_tip_um"] = numbers.u_tip_um.round(_DECIMALS_UM).tolist()
    if numbers.shadow is not None:
        parts = numbers.shadow._asdict().items()
        found["shadow"] = {
            name: part if isinstance(part, str) else part.round(_DECIMALS_MM).tolist()
            for name, part in parts
            if part is not None
        }
    return found


def _rounded(vectors: list[FloatArray]) -> Iterator[list[float]]:
    flat = np.concatenate(vectors).round(_DECIMALS_MM).tolist()
    start = 0
    for vector in vectors:
        end = start + len(vector)
        yield flat[start:end]
        start = end
