"""The page of the criteria: every threshold of a comparison, a diagnosis and a fleet, with its meaning and reason."""

from __future__ import annotations

import json
from dataclasses import Field, fields
from functools import cache
from pathlib import Path
from typing import Any

from compd.comparison.criteria import ComparisonCriteria
from compd.diagnosis import Criteria
from compd.fleet.criteria import FleetCriteria
from docs.generate.markdown import code, escape, heading, join, sentence, table, target, term

# Written by `python -m tests.scoreboard.sensitivity --figures`.
COUNTS = Path(__file__).parent.parent / "sensitivity.json"


@cache
def counts() -> dict[str, Any]:
    """What halving and doubling each threshold does."""
    read: dict[str, Any] = json.loads(COUNTS.read_text(encoding="utf-8"))
    return read


INTRODUCTION = f"""\
The result of `compd compare`, the verdict of `compd diagnose`, and what `compd fleet report` names rest on the
thresholds of this page and on no others.
Each has its default, its unit, its meaning, and the reason for its value; a reason that begins with "A choice" says
that there is no derivation. [How a verdict is reached](../explanation/how-a-verdict-is-reached.md) shows where each
enters.

Losses are mean squares per measured value divided by the variance of the noise: 1.0 is the {term("noise floor")}, and a
difference of losses is in squares of the noise floor. Where the unit is 1, the number has none.

What a number does shows when it is halved and doubled, alone, and simulated machines are diagnosed again
(`{counts()["command"]}`, {counts()["counted"]}, {counts()["cases"]} machines). The counts are *right, near and
dangerous*, as [How often it is right](../explanation/how-often-it-is-right.md) explains them; with all numbers as they
are, {counts()["as it is"]}.

In Python, hand other thresholds to `compd.diagnose` as `criteria=`.
"""


def page() -> str:
    """Markdown, from the fields of both classes and their metadata."""
    return join(
        "# Criteria",
        INTRODUCTION,
        _part("Diagnosis", "diagnosis", Criteria),
        _part("Comparison", "comparison", ComparisonCriteria),
        _part("A fleet of machines", "fleet", FleetCriteria),
    )


def _part(title: str, name: str, kind: type[Any]) -> str:
    criteria = [field for field in fields(kind) if isinstance(field.default, int | float)]
    tried = any(criterion.name in counts()["thresholds"] for criterion in criteria)
    header = ["criterion and its default", "meaning, and the reason for the default", *(["half", "twice"] * tried)]
    return join(heading(2, title, target("criteria", name)), table(header, [_row(field, tried) for field in criteria]))


def _row(criterion: Field[Any], tried: bool) -> list[str]:
    unit = criterion.metadata["unit"]
    default = f"{criterion.default:g}" + ("" if unit == "1" else f" {escape(unit)}")
    meaning, reason = (escape(sentence(criterion.metadata[key])) for key in ("meaning", "reason"))
    cells = [f"{code(criterion.name)}<br>{default}", f"{meaning}<br>*Reason:* {reason}"]
    if not tried:
        return cells
    changed = counts()["thresholds"].get(criterion.name, {})
    return [*cells, *(changed.get(change, "not counted") for change in ("half", "twice"))]
