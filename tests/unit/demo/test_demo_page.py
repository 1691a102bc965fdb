"""The demo's page and tables say what the session saw, and nothing when it saw nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from compd.demo.page import write_demo_page
from compd.demo.session import DemoSession, DemoVisit
from compd.demo.summary import error_rows, timing_rows, verdict
from compd.text import typeset

SETPOINT: dict[str, Any] = {
    "time_s": 100.0,
    "age_s": 0.02,
    "sources_mm": {"joints": [0.001, 0.002, 0.003], "frame": [0.004, 0.005, 0.006]},
    "frame": {"displacement_M_mm": [0.001, 0.0, 0.008]},
}


def session() -> DemoSession:
    visits = [
        DemoVisit(1.0, (1.0, 2.0, 3.0), {"none": 3.0, "joints": 2.0, "full": 0.3}, SETPOINT),
        DemoVisit(2.0, (4.0, 5.0, 6.0), {"none": 4.0, "joints": 1.0, "full": 0.4}, SETPOINT),
    ] * 3
    return DemoSession("tripod-cmm", visits, [SETPOINT], {"loop": {"rate_hz": 200.0, "missed_cycles": 0}}, cycles=4000)


def test_the_errors_are_rms_and_largest_of_the_visits() -> None:
    none, _, full = error_rows(session())
    assert none == ["no compensation", "3.54 um", "4.00 um", "4.00 um"]
    assert full[3] == "0.40 um"


def test_timing_comes_from_status_and_setpoints() -> None:
    rows = dict(timing_rows(session()))
    assert rows["loop rate, Hz"] == "200"
    assert rows["missed cycles"] == "0"
    assert rows["age of the oldest gauge, largest, ms"] == "20.0"


def test_the_page_works_offline_and_holds_the_verdict(tmp_path: Path) -> None:
    page = tmp_path / "demo.html"
    write_demo_page(page, session())
    text = page.read_text()
    assert typeset(verdict(session())) in text
    assert "<script src=" not in text, "nothing may be loaded from a network"
    for title in ("Error of the tool tip", "What the correction is made of", "How the frame moved"):
        assert f"<h2>{title}</h2>" in text
