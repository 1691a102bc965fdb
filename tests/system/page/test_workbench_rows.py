"""Recordings of 5,000 and 100,000 rows in a real browser: pictures are thinned, numbers are of all rows."""

from __future__ import annotations

import numpy as np
import pytest

from compd.api import compare
from compd.comparison import open_recording
from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import page_without_machine
from tests.system.page.test_workbench import lasso

pytestmark = pytest.mark.long
SLOW_S = 200.0


@pytest.mark.parametrize("rows", [5_000, 100_000])
def test_numbers_are_of_all_rows_and_pictures_of_some(chromium, tmp_path, rows):
    (tmp_path / "recordings").mkdir()
    path = record(tmp_path / "recordings", gauges(rows, 1), [hidden("link_expansion", 4.0)], name="long-1")
    comparison = compare(open_recording(path))
    with page_without_machine(tmp_path) as (address, _):
        tab = chromium.new_context(viewport={"width": 1366, "height": 768}).new_page()
        tab.goto(address)
        tab.goto(address.partition("?")[0] + "workbench?recording=long-1&model=long.model.yaml")
        until(tab, "document.querySelectorAll('.effect').length > 5", SLOW_S)
        assert tab.evaluate("bench.rows.row.length") == 5_000, "pictured"
        assert tab.evaluate("bench.summary.rows") == rows
        assert tab.evaluate("bench.summary.rms") == pytest.approx(comparison.rms_um)
        assert tab.locator(".effect").first.get_attribute("data-effect") == "link_expansion"
        tab.locator(".effect").first.click()
        until(tab, "bench.trial", SLOW_S)
        tab.locator("#fit").click()
        tried = tab.evaluate("bench.tried_rms")
        assert tried == pytest.approx(comparison.floor.um, rel=0.05)
        assert tab.evaluate("bench.trial.values") == 3 * int(comparison.used.sum()), "all rows"
        tab.locator("[role=tab]", has_text="time").click()
        lasso(tab, [(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.0, 1.0)])
        until(tab, "bench.selection.rows.size > 0", SLOW_S)
        chosen = np.array(tab.evaluate("[...bench.selection.rows]"))
        early = comparison.aligned.recording.row[comparison.used]
        # left of the middle of the picture lies the first half but for the margin
        assert 0.4 * rows < len(chosen) < 0.5 * rows
        assert set(chosen.tolist()) == set(early[: len(chosen)].tolist())
