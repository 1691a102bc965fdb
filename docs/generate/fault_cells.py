"""Every fault in every situation, as measured by `make faults`. This module is no page: it has no function `page`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from docs.generate.markdown import escape, heading, join, table, target
from tests.injection.case import Case
from tests.injection.cells.situation import Situation
from tests.injection.verdict import BEYOND_MOST, BEYOND_SHARE

# Written by `make faults OPTIONS="--write docs/faults.json"`.
MEASURED = Path(__file__).parent.parent / "faults.json"
Document = Mapping[str, Any]
Result = Mapping[str, Any]


@cache
def measured() -> Document:
    """What the runs of all cases have seen."""
    document: Document = json.loads(MEASURED.read_text(encoding="utf-8"))
    return document


def results(document: Document) -> Sequence[Result]:
    """Of each cell; none before `make faults` has been run."""
    found: Sequence[Result] = document.get("cells", ())
    return found


def results_of(document: Document, *cases: Case) -> list[Result]:
    """Of the cells of these faults together, in the order of the situations; of none, those without a fault."""
    faults = [case.id for case in cases]
    found = [result for result in results(document) if result["faults"] == faults]
    return sorted(found, key=lambda result: list(Situation.__members__).index(result["situation"].upper()))


def figures(result: Result) -> str:
    """Situation, largest error and the bound that this setpoint stated."""
    situation = Situation[result["situation"].upper()].value
    if result["worst_um"] is None:
        return f"{situation}: none valid"
    return f"{situation}: {_um(result['worst_um'])} of {_um(result['worst_bound_um'])}"


def introduction(document: Document) -> str:
    """What the figures of the cells are; "" where there are none."""
    if not results(document):
        return ""
    beyond = f"{BEYOND_SHARE:.0%}".replace("%", " %")
    return f"""\
*Error of bound* is from the same run, which tries every fault in four situations: at rest, in motion from place to
place, at a restart of the daemon, and on a busy computer, on which the daemon wakes late and stalls. The first number
is the largest error of a valid setpoint, the second the bound that this setpoint stated as `u_tip_um`. Where a fault
can be seen, no more than {beyond} of the setpoints may be valid and beyond their bound, and none beyond
{BEYOND_MOST:g} times it.
"""


def overview(document: Document) -> str:
    """Without a fault, and with two at once."""
    if not results(document):
        return ""
    pairs = [result for result in results(document) if len(result["faults"]) > 1]
    beyond = sorted((r for r in pairs if (r["most"] or 0.0) > 1.0), key=lambda result: -result["most"])
    rows = [
        [escape(" + ".join(result["faults"])), figures(result), str(result["beyond"]), str(result["setpoints"])]
        for result in beyond
    ]
    return join(
        heading(2, "No fault, and two at once", target("faults", "pairs")),
        "Without a fault: " + "; ".join(map(figures, results_of(document))) + ".",
        f"{len(pairs)} pairs of faults were drawn, each with a situation. In {len(pairs) - len(beyond)} of them every "
        "valid setpoint was within its bound." + (" The others:" if rows else ""),
        table(["faults", "error of bound", "beyond", "setpoints"], rows) if rows else "",
    )


def _um(value: float | None) -> str:
    return number(value, "um", 2 if value is None or value < 10.0 else 0)


def number(value: float | None, unit: str, decimals: int) -> str:
    """With its unit; a dash where there is none."""
    return "-" if value is None or math.isnan(value) else f"{value:.{decimals}f} {unit}"
