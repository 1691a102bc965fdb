"""The shadow model beside the applied one: at the links and at the tip, and nowhere while none runs."""

from __future__ import annotations

from contextlib import contextmanager

import pytest

from compd.client import connect
from tests.support.live_models import file_with
from tests.support.live_page import until

pytestmark = pytest.mark.long


@contextmanager
def shadow_of(live, file):
    with connect(live.socket, 30.0) as daemon:
        daemon.model(str(file), shadow=True)
        try:
            yield
        finally:
            daemon.model("", shadow=True)


def test_the_shadow_is_outlined_at_links_and_tip_while_it_runs(tab, live, tmp_path):
    until(tab, "document.querySelectorAll('#budget .sum').length >= 3")
    assert tab.locator(".shadow").count() == 0
    with shadow_of(live, file_with(tmp_path / "a.model.yaml", "link_zero", link_zero=20.0)):
        until(tab, "document.querySelectorAll('#strips .bar .shadow').length === 3")
        until(tab, "document.querySelectorAll('#budget .bar .shadow').length === 3")
        # 20 um on each of three links that stand symmetrically lift or lower the tip
        until(tab, "Math.abs(compd.live.shadow_budget[2]) > 5")
        until(tab, "/shadow .\\d+\\.\\d µm/.test(document.querySelectorAll('#budget .axis small')[2].textContent)")
        assert "not applied" in tab.locator("#budget .legend").inner_text()
        assert "shadow" in tab.locator(".strip .number small").first.inner_text()
    until(tab, "!document.querySelector('main .shadow')")
