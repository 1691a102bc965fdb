"""The README's table "What it costs", from what one run of the benchmarks has measured.

`docs/costs.json` keeps the figures; `python -m tests.benchmarks.costs` writes both.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from docs.generate.markdown import table

ROOT = Path(__file__).parents[2]
COSTS = ROOT / "docs" / "costs.json"
README = ROOT / "README.md"
BEGIN, END = "<!-- costs, written by `make costs` -->\n", "<!-- end of costs -->\n"


class Cost(NamedTuple):
    """One line of the table: what was measured, what it took, what took turns with it, and the ratio of both."""

    what: str
    figure: str
    beside: str
    ratio: str


def save(costs: Sequence[Cost], date: str, processors: int) -> None:
    """Write the figures, and the table in the README."""
    measured = {"date": date, "processors": processors, "costs": [cost._asdict() for cost in costs]}
    COSTS.write_text(json.dumps(measured, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    README.write_text(with_table(README.read_text(encoding="utf-8"), measured), encoding="utf-8")


def with_table(readme: str, measured: dict[str, Any]) -> str:
    """The README with the table of these figures between its marks."""
    before, _, rest = readme.partition(BEGIN)
    _, _, after = rest.partition(END)
    rows = [list(cost.values()) for cost in measured["costs"]]
    header = [f"measured on {measured['date']}, {measured['processors']} processors", "", "beside it", "ratio"]
    return f"{before}{BEGIN}{table(header, rows)}{END}{after}"
