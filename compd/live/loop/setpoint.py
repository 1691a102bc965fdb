"""The setpoint, which is the result of one cycle, and its encodings: a line of JSON and a packet of fixed size."""

from __future__ import annotations

import math
import pickle
import zlib
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
import orjson

from compd.arrays import FloatArray
from compd.compensation import Compensation
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleInputs, CycleState
from compd.live.loop.packet_layout import (
    BODY,
    FLAG_TOOL_ON_PLATE,
    FLAG_VALID,
    LAYOUT_VERSION,
    MAGIC,
    NO_TARGET_ID,
    PACKET_LINKS,
    PACKET_SIZE,
)
from compd.setpoint_states import Mode, State
from compd.units import UM_PER_MM

# 0.1 nm: a hundredth of the resolution of the best comparators.
_DECIMALS_MM = 7
# 0.1 nrad: 0.1 nm at the end of a lever of 1 m.
_DECIMALS_RAD = 10
_DECIMALS_S = 6
# As columns of a recording.
_DECIMALS_OWN = 9
# 0.1 nm, as lengths: an uncertainty is not known better.
_DECIMALS_UM = 4

_PICKLE_PROTOCOL = 5
_STATES = {state.code: state for state in State}
_MODES = {mode.code: mode for mode in Mode}
_NO_VECTORS: tuple[float, ...] = (math.nan,) * (9 + 3 * PACKET_LINKS)


class ShadowResult(NamedTuple):
    """What the shadow model asks for in the same cycle; nothing of it is applied."""

    model: str  #: hash of its file
    reason: str  #: why there are no values; "" where there are
    correction_mm: FloatArray | None = None  #: (n), before the limits
    tip_M_mm: FloatArray | None = None  #: (3)
    tip_P_mm: FloatArray | None = None  #: (3), with the tool on the plate


class Setpoint(NamedTuple):
    """Result of one cycle."""

    seq: int  #: number of the cycle, whether valid or not; a gap is a missed cycle or a dropped message
    time_s: float  #: time_s, valid_until_s: monotonic seconds; an invalid setpoint has expired when it is made
    valid_until_s: float
    age_s: float  #: age of the oldest reading used; nan where none was
    state: State  #: how it came about
    reason: str  #: why the state is not ok; "" when it is
    mode: Mode  #: what determined the tip
    #: the compensation with the correction that is applied, within its limits, and the scale setpoint that belongs to
    #: it; its contributions are what each cause asks for, before the limits. None unless valid, so that no value can be
    #: taken for a good one, and in a setpoint that `unpack` returned.
    values: Compensation | None
    model: str = ""  #: hash of the model file that was applied; "" without effects
    #: inputs, state_before: what it was computed from, for READINGS messages; of them a SETPOINT has the target's time
    #: and id
    inputs: CycleInputs | None = None
    state_before: CycleState | None = None
    #: how much later than the oldest the newest length that was used was measured; nan where that is not known
    skew_s: float = math.nan
    #: how far the tip may be from the place on the work with the tool on the plate, else from `tip_M_mm`, with 95 %;
    #: nan where it is not known. Of a recording of a release up to 0.2.0 its standard uncertainty along x, y, z, or
    #: None.
    u_tip_um: float | FloatArray | None = math.nan
    shadow: ShadowResult | None = None  #: result of the model that runs beside the applied one; None without one
    #: whether the tool stands on the plate: `tip_P_mm` of the values is the place on the work then
    tool_on_plate: bool = False
    line: bytes = b""  #: its JSON, with the newline
    packet: bytes = b""  #: for UDP. Both are b"" but in what `unpack` returned.

    @property
    def valid(self) -> bool:
        return self.state.valid

    @property
    def _target(self) -> Target | None:
        """The target that it answers; None in CMM mode."""
        return None if self.inputs is None else self.inputs.target

    def pack(self, config_hash: bytes | None) -> tuple[bytes, bytes]:
        """Its line, and what clients are sent of it as the content of a ring's entry: the line among it.

        config_hash : for the packet; None for no packet.
        """
        line, packet = self.to_json(), b"" if config_hash is None else self.to_packet(config_hash)
        content = (*self[:4], self.state.code, self.reason, self.mode.code, line, packet)
        return line, pickle.dumps(content, _PICKLE_PROTOCOL)

    @classmethod
    def unpack(cls, content: bytes) -> Self:
        """From the content of an entry: with line and packet, without values and what it was computed from."""
        seq, time_s, valid_until_s, age_s, state, reason, mode, line, packet = pickle.loads(content)
        head = seq, time_s, valid_until_s, age_s, _STATES[state], reason, _MODES[mode]
        return cls(*head, None, line=line, packet=packet)

    def to_json(self) -> bytes:
        """One line of JSON, with its newline. Keys without a value are absent.

        Raises ValueError where a value is not finite.
        """
        return setpoint_line(self.message())

    def message(self, moved_mm: float = 0.0) -> dict[str, Any]:
        """The keys of its JSON. Raises ValueError where a value is not finite.

        moved_mm : added to every computed number before it is rounded: as much of the last decimal of an angle, and of
            an uncertainty, as it is of the last decimal of a length.
        """
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
        if self._target is not None:
            message |= _target_named(self._target)
        if self.model:
            message["model"] = self.model
        if math.isfinite(self.age_s):
            message["age_s"] = round(self.age_s, _DECIMALS_S)
        if math.isfinite(self.skew_s):
            message["skew_s"] = round(self.skew_s, _DECIMALS_S)
        if self.values is not None:
            message |= self._json_values(self.values, moved_mm)
        return message

    def _json_values(self, values: Compensation, moved_mm: float) -> dict[str, Any]:
        """The values as rounded lists, under their keys in the message."""
        frame, contributions = values.frame, values.contributions
        vectors = [
            values.tip_M_mm,
            values.tip_B0_mm,
            frame.origin_M_mm,
            frame.displacement_M_mm,
            values.link_length_mm,
            values.scale_setpoint_mm,
            values.correction_mm,
        ]
        if self.tool_on_plate:
            vectors.append(values.tip_P_mm)
        by_cause_mm = contributions.by_cause_mm
        vectors.append(by_cause_mm.ravel())
        # rounding one long array costs as much as rounding one of three elements
        lengths = _rounded(np.concatenate(vectors), _DECIMALS_MM, moved_mm)
        n, links, width = len(values.correction_mm), len(values.link_length_mm), by_cause_mm.shape[1]
        sources_at = len(lengths) - by_cause_mm.size
        message: dict[str, Any] = {
            "tip_M_mm": lengths[:3],
            "tip_B0_mm": lengths[3:6],
            **_json_links(lengths[12:], links, n),
            "frame": {
                "origin_M_mm": lengths[6:9],
                "displacement_M_mm": lengths[9:12],
                "rotation_M_rad": _rounded(frame.rotation_M_rad, _DECIMALS_RAD, moved_mm),
            },
            "sources_mm": {
                cause: lengths[sources_at + k * width : sources_at + (k + 1) * width]
                for k, cause in enumerate(contributions.causes)
            },
        }
        if self.tool_on_plate:
            message["tip_P_mm"] = lengths[12 + links + 2 * n : sources_at]
        if values.rotation_M_rad is not None or values.pose_correction is not None:
            message |= _json_pose(values, moved_mm)
        u_tip_um = self.u_tip_um
        if isinstance(u_tip_um, float):
            if math.isfinite(u_tip_um):
                message["u_tip_um"] = round(u_tip_um + moved_mm * UM_PER_MM, _DECIMALS_UM)
        elif u_tip_um is not None and math.isfinite(u_tip_um.sum()):
            message["u_tip_um"] = _rounded(u_tip_um, _DECIMALS_UM, moved_mm)
        if self.shadow is not None:
            message["shadow"] = {
                name: field if isinstance(field, str) else _rounded(field, _DECIMALS_MM, moved_mm)
                for name, field in self.shadow._asdict().items()
                if field is not None and (isinstance(field, str) or len(field))
            }
        return message

    def to_packet(self, config_hash: bytes) -> bytes:
        """`PACKET_SIZE` bytes, little-endian; the links a machine does not have are nan.

        config_hash : the first 8 bytes of the configuration's hash.
        """
        values, target = self.values, self._target
        vectors = _NO_VECTORS
        links = flags = 0
        if values is not None:
            tip_mm = values.tip_P_mm if self.tool_on_plate else values.tip_M_mm
            links = len(values.correction_mm)
            flags = FLAG_VALID | FLAG_TOOL_ON_PLATE if self.tool_on_plate else FLAG_VALID
            unused = (math.nan,) * (PACKET_LINKS - links)
            unknown = (math.nan,) * (PACKET_LINKS - len(values.link_length_mm))
            of_pose = links == 0 and values.pose_correction is not None
            correction = values.pose_correction if of_pose else values.correction_mm
            assert correction is not None, "checked above"
            vectors = (
                *tip_mm.tolist(),
                *values.frame.displacement_M_mm.tolist(),
                *values.frame.rotation_M_rad.tolist(),
                *values.link_length_mm.tolist(),
                *unknown,
                *values.scale_setpoint_mm.tolist(),
                *unused,
                *correction.tolist(),
                *((math.nan,) * (PACKET_LINKS - len(correction))),
            )
        body = BODY.pack(
            MAGIC,
            LAYOUT_VERSION,
            PACKET_SIZE,
            self.seq,
            self.time_s,
            self.valid_until_s,
            self.age_s,
            flags,
            self.state.code,
            self.mode.code,
            links,
            *vectors,
            config_hash,
            math.nan if target is None else target.time_s,
            NO_TARGET_ID if target is None or target.id is None else target.id,
        )
        return body + zlib.crc32(body).to_bytes(4, "little")


def setpoint_line(message: Mapping[str, Any]) -> bytes:
    """A SETPOINT message as it is sent; orjson takes a tenth of the time of the standard library."""
    return orjson.dumps(message) + b"\n"


def _json_links(numbers: list[float], links: int, scales: int) -> dict[str, list[float]]:
    """What is known of links and scales, by key. numbers : first the links' lengths, setpoints, corrections."""
    parts = {
        "link_length_mm": numbers[:links],
        "scale_setpoint_mm": numbers[links : links + scales],
        "correction_mm": numbers[links + scales : links + 2 * scales],
    }
    return {name: part for name, part in parts.items() if part}


def _json_pose(values: Compensation, moved_mm: float) -> dict[str, Any]:
    """Attitude and correction of the pose, as far as they are known."""
    correction = values.pose_correction
    rotation_correction_rad = None if correction is None or np.isnan(correction[3:]).any() else correction[3:]
    known = {
        "rotation_M_rad": (values.rotation_M_rad, _DECIMALS_RAD),
        "tip_correction_mm": (None if correction is None else correction[:3], _DECIMALS_MM),
        "rotation_correction_rad": (rotation_correction_rad, _DECIMALS_RAD),
    }
    message: dict[str, Any] = {
        name: _rounded(numbers, decimals, moved_mm)
        for name, (numbers, decimals) in known.items()
        if numbers is not None
    }
    if values.own_columns:
        columns = np.array(list(values.own_columns.values()))
        message["own_columns"] = dict(zip(values.own_columns, _rounded(columns, _DECIMALS_OWN, moved_mm), strict=True))
    return message


def _target_named(target: Target) -> dict[str, Any]:
    """Which target it is. One without a time was recorded by a release that did not tell it."""
    if not math.isfinite(target.time_s):
        return {}
    named = {"target_time_s": round(target.time_s, _DECIMALS_S)}
    return named if target.id is None else named | {"target_id": target.id}


def _rounded(values: FloatArray, decimals: int, moved_mm: float) -> list[Any]:
    """The values (k,) or (l, k) as rounded lists. Raises ValueError where one is not finite, which JSON lacks."""
    if moved_mm:
        values = values + moved_mm * 10.0 ** (_DECIMALS_MM - decimals)
    lists: list[Any] = values.round(decimals).tolist()
    if not math.isfinite(sum(lists) if values.ndim == 1 else sum(map(sum, lists))):
        raise ValueError("a value of the setpoint is not finite")
    return lists
