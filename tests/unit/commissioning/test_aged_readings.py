"""`compd gauge read` and `watch` say how old a reading is, and that an old one is stale."""

from __future__ import annotations

import pytest

from compd.gauge import Quality, bad, good
from compd.gauge_tools import aged, gauge_of_driver, gauge_of_file
from compd.gauge_tools.open_gauge import STALE_AFTER_S
from compd.lines import PortArguments
from tests.support.paths import CONFIG

OPC_UA = PortArguments("opc.tcp://127.0.0.1:4840", None, None, 1.0)
NODE = 'channels=[{name: value, node: "nsu=http://x/p;s=Probe1", unit: um}]'


@pytest.mark.parametrize(
    ("age_s", "text"), [(11.0, "11 s"), (300.0, "5 min"), (3 * 3600.0, "3 h"), (329.25 * 86400.0, "329 days")]
)
def test_an_old_reading_is_stale(age_s: float, text: str) -> None:
    reading = aged(good(0.012005, 5000.0 - age_s), 5000.0, STALE_AFTER_S)
    assert reading.quality is Quality.STALE
    assert f"0.012005 was measured {text} ago" in reading.detail


def test_a_young_reading_and_a_fault_stay() -> None:
    young, fault = good(0.5, 4999.0), bad(1.0, Quality.TIMEOUT, "no byte")
    assert aged(young, 5000.0, STALE_AFTER_S) is young
    assert aged(fault, 5000.0, STALE_AFTER_S) is fault


def test_what_counts_as_old_is_the_gauges_the_machines_or_usual() -> None:
    assert gauge_of_driver("opc_ua", OPC_UA, [NODE]).stale_after_s == STALE_AFTER_S
    assert gauge_of_driver("opc_ua", OPC_UA, [NODE, "stale_after_s=120"]).stale_after_s == 120.0
    port = PortArguments("", None, None, 1.0)
    assert gauge_of_file(CONFIG / "tripod-cmm.yaml", "scale_1", port).stale_after_s == 0.5
