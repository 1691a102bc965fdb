"""The page of the criteria: every threshold of a comparison and of a diagnosis, with its meaning and its reason."""

from __future__ import annotations

from dataclasses import Field, fields
from typing import Any

from compd.comparison.criteria import ComparisonCriteria
from compd.diagnosis.criteria import Criteria
from docs.generate.markdown import code, escape, heading, join, sentence, table, target, term

INTRODUCTION = f"""\
The result of `compd compare` and the verdict of `compd diagnose` rest on the thresholds of this page and on no others.
Each has its default, its unit, its meaning, and the reason for its value; a reason that begins with "A choice" says
that there is no derivation. [How a verdict is reached](../explanation/how-a-verdict-is-reached.md) shows where each
enters.

Losses are mean squares per measured value divided by the variance of the noise: 1.0 is the {term("noise floor")}, and a
difference of losses is in squares of the noise floor. Where the unit is 1, the number has none.

In Python, hand other thresholds to `compd.diagnose` as `criteria=`.
"""


def page() -> str:
    """Markdown, from the fields of both classes and their metadata."""
    return join(
        "# Criteria",
        INTRODUCTION,
        _part("Diagnosis", "diagnosis", Criteria),
        _part("Comparison", "comparison", ComparisonCriteria),
    )


def _part(title: str, name: str, kind: type[Any]) -> str:
    criteria = [field for field in fields(kind) if isinstance(field.default, int | float)]
    return join(
        heading(2, title, target("criteria", name)),
        table(["criterion and its default", "meaning, and the reason for the default"], map(_row, criteria)),
    )


def _row(criterion: Field[Any]) -> list[str]:
    unit = criterion.metadata["unit"]
    default = f"{criterion.default:g}" + ("" if unit == "1" else f" {escape(unit)}")
    meaning, reason = (escape(sentence(criterion.metadata[key])) for key in ("meaning", "reason"))
    return [f"{code(criterion.name)}<br>{default}", f"{meaning}<br>*Reason:* {reason}"]
