"""STATUS says how far a length scatters at rest, and what is to be looked at."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from compd.gauge import ReadingMotion, good
from compd.live.memory.latest import Latest
from compd.live.memory.shared_message import SharedMessage
from compd.live.memory.trust_memory import TrustMemory
from compd.live.service.message_keys.status import ChannelStatusKeys
from compd.live.service.status_message import StatusReport
from tests.support.hand_clock import HandClock
from tests.support.service import NO_ZERO

CHANNELS = ("scale_1.position", "scale_2.position")


def test_scatter_and_warning_stand_beside_their_channel() -> None:
    clock, latest, trust = HandClock(), Latest(CHANNELS), TrustMemory(CHANNELS, [0.001, 0.001])
    unknown = ReadingMotion(0.0, 0.0, 0.1, 0.02)
    latest.put(0, good(1.0, clock.now_s)._replace(motion=unknown._replace(scatter_mm=0.00354)))
    latest.put(1, good(2.0, clock.now_s)._replace(motion=unknown))
    trust.warnings.write({"scale_1.position": "scatters by 3.5 um at rest, declared: 0.1 um (`noise_um`)"})
    nothing: Any = SimpleNamespace(summary=dict)
    control: Any = SimpleNamespace(realtime=SharedMessage(), processes=SharedMessage())
    commands: Any = SimpleNamespace(target=None, zero=NO_ZERO)
    wires: Any = SimpleNamespace(length_wires=[], all_wires=[])
    adopted: Any = SimpleNamespace(summary={})
    report = StatusReport(
        version={},
        latest=latest,
        wires=wires,
        commands=commands,
        adopted=adopted,
        timing=nothing,
        control=control,
        publisher=nothing,
        packets=None,
        lines=dict,
        trust=trust,
        clock=clock,
        ports={},
    )
    first, second = report.message()["gauges"]
    assert first["scatter_um"] == 3.54
    assert first["warning"].startswith("scatters by 3.5 um")
    assert {"scatter_um", "warning"}.isdisjoint(second)
    for entry in (first, second):
        ChannelStatusKeys.model_validate(entry)
