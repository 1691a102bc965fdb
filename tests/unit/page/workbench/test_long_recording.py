"""A recording that is too long for the memory opens in the page by its sample."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

import compd
from compd.comparison import open as open_module
from compd.page.workbench.workbench import Workbench
from tests.support.measured import gauges, hidden, record


def test_it_opens_by_a_sample_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = record(tmp_path, gauges(600, 1), [hidden("link_expansion", 2.0)])
    model = tmp_path / "tripod.model.yaml"
    whole = Workbench(path, model, None).summary()
    assert (whole["rows"], whole["sample"]) == (600, "")
    monkeypatch.setattr(open_module, "LONG_ROWS", 300)
    monkeypatch.setattr(open_module, "open_sample", partial(compd.open_sample, rows=200))
    workbench = Workbench(path, model, None)
    summary = workbench.summary()
    assert 150 < summary["rows"] < 250
    assert f"{summary['rows']} of 600 rows" in summary["sample"]
    assert summary["rms"] == pytest.approx(whole["rms"], rel=0.15)
    step = workbench.propose("add", "link_expansion")
    before, after = step["rms"]
    assert after < 0.3 * before
