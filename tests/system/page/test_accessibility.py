"""The page can be read and used without a mouse, without colours, and with little sight: the rules of axe-core."""

from __future__ import annotations

import pytest

from tests.support.live_page import opened, until

pytestmark = [pytest.mark.timeout(180), pytest.mark.long, pytest.mark.sample]


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
