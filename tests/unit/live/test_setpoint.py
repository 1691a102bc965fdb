"""A setpoint's two forms: what a JSON parser and an independent reading of the packet find in them."""

from __future__ import annotations

import json
import math
import struct
import zlib

import numpy as np
import pytest

from compd.compensation import Compensation
from compd.compensation.values import Contributions
from compd.errors import StateError
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleInputs
from compd.live.loop.packet_layout import PACKET_SIZE
from compd.live.loop.setpoint import Setpoint
from compd.live.memory import Snapshot
from compd.model.kinematics import Frame
from compd.setpoint_states import Mode, State

HASH = bytes.fromhex("0123456789abcdef")


UNUSED = np.full(3, math.nan)


def numbers(links: int = 3) -> Compensation:
    each = np.arange(1, links + 1, dtype=float)
    frame = Frame(
        UNUSED,
        np.array([0.001, 0.002, 700.003]),
        UNUSED,
        UNUSED,
        np.array([0.001, 0.002, 0.003]),
        np.array([1e-6, 2e-6, -3e-6]),
        *(np.array(0),) * 3,
    )
    return Compensation(
        tip_M_mm=np.array([1.123456789123, -2.5, 190.0]),
        tip_B0_mm=np.array([1.0, -2.0, -510.0]),
        tip_P_mm=np.array([5.0, 6.0, 7.0]),
        rotation_M_P=UNUSED,
        frame=frame,
        link_length_mm=400 + each,
        target_B_mm=UNUSED,
        nominal_scale_mm=UNUSED,
        scale_setpoint_mm=10 + each,
        correction_mm=each / 100,
        contributions=Contributions(("joints", "frame"), np.array([each / 300, each / 150])),
        reason=np.array(0),
    )


def setpoint(values: Compensation | None, state: State = State.OK, mode: Mode = Mode.CMM) -> Setpoint:
    return Setpoint(42, 1234.5678901, 1234.6678901, 0.0123456, state, "" if values else "why", mode, values)


def test_json_is_one_line_with_every_documented_key():
    encoded = setpoint(numbers()).to_json()
    assert encoded.endswith(b"\n")
    assert encoded.count(b"\n") == 1
    assert json.loads(encoded) == {
        "class": "SETPOINT",
        "seq": 42,
        "time_s": 1234.56789,
        "valid": True,
        "state": "ok",
        "reason": "",
        "valid_until": 1234.66789,
        "mode": "cmm",
        "age_s": 0.012346,
        "tip_M_mm": [1.1234568, -2.5, 190.0],
        "tip_B0_mm": [1.0, -2.0, -510.0],
        "frame": {
            "origin_M_mm": [0.001, 0.002, 700.003],
            "displacement_M_mm": [0.001, 0.002, 0.003],
            "rotation_M_rad": [1e-6, 2e-6, -3e-6],
        },
        "link_length_mm": [401, 402, 403],
        "scale_setpoint_mm": [11, 12, 13],
        "correction_mm": [0.01, 0.02, 0.03],
        "sources_mm": {"joints": [0.0033333, 0.0066667, 0.01], "frame": [0.0066667, 0.0133333, 0.02]},
    }


def test_json_of_an_invalid_setpoint_has_no_number_that_looks_alive():
    message = json.loads(setpoint(None, State.STOP)._replace(age_s=math.nan).to_json())
    assert set(message) == {"class", "seq", "time_s", "valid", "state", "reason", "valid_until", "mode"}
    assert message["valid"] is False
    assert message["reason"] == "why"


def test_json_with_the_tool_on_the_plate_tells_the_touched_place():
    message = json.loads(setpoint(numbers())._replace(tool_on_plate=True).to_json())
    assert message["tip_P_mm"] == [5.0, 6.0, 7.0]
    assert message["tip_M_mm"] == [1.1234568, -2.5, 190.0]


def test_json_never_holds_nan():
    broken = numbers()._replace(tip_M_mm=np.array([math.nan, 0, 0]))
    with pytest.raises(ValueError, match="not finite"):
        setpoint(broken).to_json()


@pytest.mark.parametrize(("links", "mode", "mode_code"), [(3, Mode.CMM, 0), (6, Mode.MACHINE_TOOL, 1)])
def test_packet_by_the_offsets_of_its_documentation(links, mode, mode_code):
    """Every field read at its documented offset, one at a time: no shared format string."""
    sent = setpoint(numbers(links), State.CLAMPED, mode)
    packet = sent.to_packet(HASH)
    assert len(packet) == PACKET_SIZE == 292

    def at(offset, kind):
        return struct.unpack_from("<" + kind, packet, offset)

    assert packet[0:4] == b"CMPD"
    assert at(4, "H") == (2,)
    assert at(6, "H") == (292,)
    assert at(8, "Q") == (42,)
    assert at(16, "d") == (1234.5678901,)
    assert at(24, "d") == (1234.6678901,)
    assert at(32, "d") == (0.0123456,)
    assert at(40, "H") == (1,)
    assert at(42, "B") == (4,)
    assert at(43, "B") == (mode_code,)
    assert at(44, "B") == (links,)
    assert packet[45:48] == bytes(3)
    assert at(48, "3d") == (1.123456789123, -2.5, 190.0)
    assert at(72, "3d") == (0.001, 0.002, 0.003)
    assert at(96, "3d") == (1e-6, 2e-6, -3e-6)
    for offset, wanted in (
        (120, sent.values.link_length_mm),
        (168, sent.values.scale_setpoint_mm),
        (216, sent.values.correction_mm),
    ):
        vector = at(offset, "6d")
        assert vector[:links] == tuple(wanted)
        assert all(map(math.isnan, vector[links:]))
    assert packet[264:272] == HASH
    assert math.isnan(*at(272, "d"))
    assert at(280, "q") == (-1,)
    assert at(288, "I") == (zlib.crc32(packet[:288]),)


def test_packet_of_an_invalid_setpoint_is_all_nan():
    packet = setpoint(None, State.NO_ZERO).to_packet(HASH)
    assert struct.unpack_from("<H", packet, 40) == (0,)
    assert packet[42] == 1
    assert packet[44] == 0
    assert all(map(math.isnan, struct.unpack_from("<27d", packet, 48)))
    assert struct.unpack_from("<I", packet, 288) == (zlib.crc32(packet[:288]),)


@pytest.mark.parametrize("state", [State.OK, State.STOP])
@pytest.mark.parametrize(("id_", "packed"), [(0, 0), (2**53, 2**53), (None, -1)])
def test_packet_names_the_target_as_the_json_does(state, id_, packed):
    target = Target((0.0, 0.0, -500.0), time_s=1234.5, id=id_)
    inputs = CycleInputs(42, Snapshot(1234.5678901, ()), StateError.of("zero", "is not there"), target)
    answer = setpoint(numbers() if state.valid else None, state, Mode.MACHINE_TOOL)._replace(inputs=inputs)
    message = json.loads(answer.to_json())
    assert (message["target_time_s"], message.get("target_id")) == (1234.5, id_)
    assert struct.unpack_from("<dq", answer.to_packet(HASH), 272) == (1234.5, packed)


def test_packet_with_the_tool_on_the_plate_carries_the_touched_place_and_says_so():
    packet = setpoint(numbers())._replace(tool_on_plate=True).to_packet(HASH)
    assert struct.unpack_from("<H", packet, 40) == (3,)
    assert struct.unpack_from("<3d", packet, 48) == (5.0, 6.0, 7.0)
