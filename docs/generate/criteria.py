"""The page of the criteria: every threshold of a comparison, a diagnosis and a fleet, with its meaning and reason."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from compd.calibration.criteria import CalibrationCriteria
from compd.comparison import ComparisonCriteria
from compd.diagnosis import Criteria
from compd.fleet.criteria import FleetCriteria
from compd.recording.fault_criteria import FaultCriteria
from compd.threshold import Threshold, thresholds
from docs.generate.markdown import code, escape, heading, join, sentence, table, target, term

# Written by `python -m tests.scoreboard.sensitivity --figures`.
COUNTS = Path(__file__).parent.parent / "sensitivity.json"


@cache
def counts() -> dict[str, Any]:
    """What halving and doubling each threshold does."""
    read: dict[str, Any] = json.loads(COUNTS.read_text(encoding="utf-8"))
    return read


INTRODUCTION = f"""\
The result of `compd compare`, the verdict of `compd diagnose`, and what `compd fleet report` and `compd calibrate`
name rest on the numbers of this page. What else stands as a number in the program is rounding, the end of an iteration,
the definition of a published method, memory and time, or the form of sentences and plans; `compd.diagnosis.criteria`
states the rule. How a recording is joined and read has its own limits, beyond which `compd recording join` and
`compd recording check` ask or refuse.

Each has its default, its unit, its meaning, and the reason for its value; a reason that begins with "A choice" says
that there is no derivation. [How a verdict is reached](../explanation/how-a-verdict-is-reached.md) shows where each
enters.

Losses are mean squares per measured value divided by the variance of the noise: 1.0 is the {term("noise floor")}, and a
difference of losses is in squares of the noise floor. Where the unit is 1, the number has none.

What a number does shows when it is halved and doubled, alone, and simulated machines are diagnosed again
(`{counts()["command"]}`, {counts()["counted"]}, {counts()["cases"]} machines). The counts are *right, near and
dangerous*, as [How often it is right](../explanation/how-often-it-is-right.md) explains them; with all numbers as they
are, {counts()["as it is"]}. A number that is "not counted" was not varied in this count.
"""

EXAMPLE = """\
In Python, `compd.diagnose` takes other numbers as `criteria=`. Those of the comparison travel with the recording:
`compd.open_recording` takes them, and `compd.compare` where a recording is compared alone. `with_value` sets a number
by its name on this page:

```pycon
>>> import compd
>>> from compd.comparison import ComparisonCriteria
>>> from compd.diagnosis import Criteria
>>> from compd.threshold import with_value
>>> files = compd.simulate_campaign("tripod-cmm", "monday.csv", seed=5, hidden=125)
>>> monday = compd.open_recording("monday.csv", criteria=ComparisonCriteria(outlier_sigmas=6.0))
>>> compd.diagnose(monday).verdict
'identified'
>>> stricter = with_value(Criteria(least_sigmas=1000.0), "search.max_members", 3)
>>> compd.diagnose(monday, criteria=stricter).verdict
'unexplained'
```
"""


CALIBRATION = """\
These are the same for every calibration: no argument changes them.
[How a calibration is reached](../explanation/how-a-calibration-is-reached.md) shows where each enters.
"""

DATA = """\
These hold wherever a recording is read, before any other criterion. Rows that are right all the same are named under
`trusted_rows:` in the sidecar.
"""


def page() -> str:
    """Markdown, from the thresholds of the classes."""
    return join(
        "# Criteria",
        INTRODUCTION,
        EXAMPLE,
        _part("Diagnosis", "diagnosis", Criteria),
        _part("Comparison", "comparison", ComparisonCriteria),
        _part("A fleet of machines", "fleet", FleetCriteria),
        _part("Calibration", "calibration", CalibrationCriteria),
        CALIBRATION,
        _part("Data that are wrong", "data", FaultCriteria),
        DATA,
    )


def _part(title: str, name: str, kind: type[Any]) -> str:
    tried = any(criterion in counts()["thresholds"] for criterion in thresholds(kind))
    header = ["criterion and its default", "meaning, and the reason for the default", *(["half", "twice"] * tried)]
    rows = [_row(criterion, field, tried) for criterion, field in thresholds(kind).items()]
    return join(heading(2, title, target("criteria", name)), table(header, rows))


def _row(name: str, criterion: Threshold, tried: bool) -> list[str]:
    unit = criterion.unit
    values = criterion.default if isinstance(criterion.default, tuple) else (criterion.default,)
    default = ", ".join(f"{value:g}" for value in values) + ("" if unit == "1" else f" {escape(unit)}")
    meaning, reason = (escape(sentence(text)) for text in (criterion.meaning, criterion.reason))
    cells = [f"{code(name)}<br>{default}", f"{meaning}<br>*Reason:* {reason}"]
    if not tried:
        return cells
    changed = counts()["thresholds"].get(name, {})
    return [*cells, *(changed.get(change, "not counted") for change in ("half", "twice"))]
