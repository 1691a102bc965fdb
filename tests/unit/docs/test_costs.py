"""The README's table of costs is what the benchmarks have measured."""

from __future__ import annotations

import json

from tests.benchmarks.cost_table import COSTS, README, with_table


def test_the_readme_has_the_measured_costs():
    readme = README.read_text(encoding="utf-8")
    assert with_table(readme, json.loads(COSTS.read_text(encoding="utf-8"))) == readme
    assert "beside it" in readme
