"""The page can be read and used without a mouse, without colours, and with little sight: the rules of axe-core."""

from __future__ import annotations

import pytest

from tests.support.live_page import opened, until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import page_without_machine

pytestmark = pytest.mark.long


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 600])
def test_no_rule_is_broken(chromium, live, scheme, width):
    from axe_playwright_python.sync_playwright import Axe

    with opened(chromium, live, color_scheme=scheme, viewport={"width": width, "height": 900}) as tab:
        until(tab, "document.querySelectorAll('#timing dd').length > 5")
        tab.locator("#gauge-table button").click()
        tab.keyboard.press("o")
        tab.locator("#order-zero").click()
        tab.wait_for_selector(".consequence")
        found = Axe().run(tab)
        assert found.violations_count == 0, found.generate_report()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1440, 890])
def test_no_rule_is_broken_in_the_workbench(chromium, tmp_path, scheme, width):
    from axe_playwright_python.sync_playwright import Axe

    (tmp_path / "recordings").mkdir()
    record(tmp_path / "recordings", gauges(200, 1), [hidden("link_expansion", 4.0)], name="monday-1")
    with page_without_machine(tmp_path) as (address, _):
        tab = chromium.new_context(color_scheme=scheme, viewport={"width": width, "height": 900}).new_page()
        tab.goto(address)
        for view, shown in (
            ("join", "document.querySelector('h1')"),
            ("workbench?recording=monday-1", "document.querySelectorAll('.effect').length > 5"),
        ):
            tab.goto(address.partition("?")[0] + view)
            until(tab, shown)
            if view != "join":
                tab.locator(".effect").first.click()
                until(tab, "bench.trial")
                tab.locator("#picture").focus()
                tab.keyboard.press("ArrowRight")
                tab.locator("#add").click()
                tab.wait_for_selector("#confirm")
            found = Axe().run(tab)
            assert found.violations_count == 0, found.generate_report()
