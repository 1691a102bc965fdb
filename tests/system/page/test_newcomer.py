"""From an empty browser to a corrected machine, by visible text and roles: an effect is added and adopted, and a gauge
that was unplugged is accepted again."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from compd.client import connect
from tests.support.live_page import LivePage, page_process
from tests.support.measured import gauges, hidden, record
from tests.support.naive_user import NaiveUser

pytestmark = [pytest.mark.timeout(600), pytest.mark.long]

ZEROS_UM = (12.0, -8.0, 5.0)
SCALE, LINE = "scale_2.position", "scale_2"


def distrusts(daemon: Any) -> bool:
    return any(gauge["quality"] == "distrusted" for gauge in daemon.status()["gauges"])


@pytest.mark.sample
def test_an_effect_is_adopted_and_a_gauge_that_was_away_is_accepted(
    chromium: Any, live: LivePage, tmp_path: Path
) -> None:
    (tmp_path / "recordings").mkdir()
    record(tmp_path / "recordings", gauges(300, 1), [hidden("link_zero", *ZEROS_UM)], name="monday-1")
    served = page_process(live.socket, tmp_path / "recordings", "--models", str(tmp_path))
    with served as (address, _), connect(live.socket, timeout_s=30.0) as daemon:
        context = chromium.new_context(viewport={"width": 1366, "height": 768})
        try:
            tab = context.new_page()
            tab.goto(address)
            user = NaiveUser(tab)
            user.follow("Workbench")
            user.open("monday-1", "mine.model.yaml")
            user.take_effect("link zero")
            user.confirm()
            user.see(re.compile(r"\d\.\d\d → 0\.1\d µm"))

            user.press("Arm for 60 s")
            user.press("Run this model as a shadow")
            user.press("Run as a shadow")
            user.see("Done: run as a shadow.")
            user.press("Adopt it")
            user.press("Adopt the shadow's model")
            user.see("Done: adopt the shadow's model.")
            assert daemon.model()["applied"]["effects"] != []

            user.follow("Live")
            row = tab.get_by_role("row").filter(has_text=SCALE)
            live.machine.ask("FAULT", line=LINE, fault="unplugged")
            row.filter(has_text=re.compile("ended|open|answer|stale|lost|unplugged")).wait_for()
            live.machine.ask("DRIVE", scale_mm=[0.3] * 3)
            while live.machine.ask("TRUTH")["moving"]:
                tab.wait_for_timeout(20)
            live.machine.ask("FAULT", line=LINE, fault=None)
            row.get_by_role("button", name=re.compile("^Accept")).click()
            user.press("Arm for 60 s")
            user.press("Accept gauges")
            user.see(re.compile(rf"Done: accept gauges\..*{re.escape(SCALE)}: believed"))
            assert not distrusts(daemon)
        finally:
            context.close()
            live.machine.ask("FAULT", line=LINE, fault=None)
            daemon.model("")
            daemon.model("", shadow=True)
