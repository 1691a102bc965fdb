"""The address of a recording opens it in the workbench, where the way on is in sight."""

from __future__ import annotations

from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import SHOWN, page_without_machine


def test_a_recording_opens_with_what_to_do_and_diagnose_and_machine_in_sight(chromium, tmp_path):
    (tmp_path / "recordings").mkdir()
    record(tmp_path / "recordings", gauges(200, 1), [hidden("link_expansion", 4.0)], name="monday-1")
    with page_without_machine(tmp_path, "--workbench", "monday-1") as (address, _):
        assert "/workbench?recording=monday-1&token=" in address
        tab = chromium.new_context(viewport={"width": 1366, "height": 768}).new_page()
        tab.goto(address)
        until(tab, SHOWN)
        assert "token" not in tab.url
        assert tab.locator("#recording").input_value() == "monday-1"
        assert tab.locator("#first-steps").inner_text().count(". ") == 2, "three sentences"
        for part in (
            tab.get_by_role("button", name="Diagnose"),
            tab.locator("#live-model h2"),
            tab.locator("#live-state"),
        ):
            box = part.bounding_box()
            assert box["y"] + box["height"] <= 768
        tab.locator(".effect").first.click()
        tab.get_by_role("button", name="Fit", exact=True).click()
        inside = "[...document.querySelectorAll('.track i')].every((one) => one.getBoundingClientRect().right"
        assert tab.evaluate(f"{inside} <= one.parentElement.getBoundingClientRect().right + 1)")
        tab.context.close()
