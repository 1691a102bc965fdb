"""The page of the fault matrix: what happens when something fails, as tested and as measured."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from docs.generate.markdown import codes, escape, fence, heading, join, table, target
from tests.injection.case import Case, Way
from tests.injection.matrix import MATRIX
from tests.injection.rig import NOISE_UM, VOTES

# Written by `python -m tests.injection --write docs/faults.json`.
MEASURED = Path(__file__).parent.parent / "faults.json"

HEADER = ["what fails", "what must happen, and the way out", "largest error, valid", "shown, `ok` again after"]


@cache
def measured() -> dict[str, Any]:
    """What a run of all cases has seen."""
    read: dict[str, Any] = json.loads(MEASURED.read_text(encoding="utf-8"))
    return read


def page() -> str:
    """Markdown, from the matrix and from what was measured."""
    groups = list(dict.fromkeys(case.group for case in MATRIX))
    return join(
        "# What happens when ...",
        _introduction(),
        _unseen(),
        *(join(heading(2, group, target("faults", group)), _table(group)) for group in groups),
    )


def _introduction() -> str:
    return f"""\
... a gauge, a line, a process or a client fails. Each row of these tables is a test: an injector between the simulated
tripod of `config/tripod-cmm.yaml` and the daemon does it to whole replies on real ports, and every setpoint that says
`valid` is compared with the true tip of the simulated machine. The machine stands still, unless a row says that it
drives. Its owner has added to the configuration:

{fence(yaml.safe_dump({"gauges": {name: {"noise_um": um} for name, um in NOISE_UM.items()}, "votes": VOTES}), "yaml")}
The columns on the right are from one run of
`{measured()["command"]}` on {measured()["date"]}:

- *largest error* of any setpoint that was valid, from the beginning of the fault until the state was `ok` again.
  Without any fault it is 0.3 um, the noise of the gauges;
- *valid*: the share of the setpoints that were valid while the fault lasted;
- *shown after*: from the beginning of the fault until state and reason said so; *`ok` again after*: from the end of the
  fault, or from `compd accept`. A dash: there was nothing to measure.

[Limits and stale gauges](../explanation/limits-and-stale-gauges.md) explains the states,
[the daemon's processes](../explanation/processes.md) who guards whom. `tests/system/test_fault_matrix.py` runs the
rows, and `make soak` lets them happen at random.
"""


def _unseen() -> str:
    """What no gauge shows, first: it is what a person has to know."""
    rows = [
        [escape(case.fault), escape(case.injected), _number(_outcome(case).get("worst_um"), "um", 1)]
        for case in MATRIX
        if case.way is Way.UNSEEN and case.at_least_um
    ]
    return join(
        heading(2, "What nothing shows", target("faults", "unseen")),
        "Each of these gauges is the only one that measures what it measures, and its part may move so. The state "
        "stays `ok`, and the tip is wrong by as much as the last column says. `compd check --what-cannot-be-seen` "
        "lists them for your machine.",
        table(["what fails", "what was injected", "tip wrong by"], rows),
    )


def _table(group: str) -> str:
    return table(HEADER, [_row(case) for case in MATRIX if case.group == group])


def _row(case: Case) -> list[str]:
    outcome = _outcome(case)
    return [
        f"{escape(case.fault)}<br>*{escape(case.injected)}*",
        f"{_must(case)}<br>Way out: {'the service manager starts it again' if case.lost else case.way.value}",
        f"{_number(outcome.get('worst_um'), 'um', 2)}, {_share(outcome.get('valid_share'))}",
        f"{_number(outcome.get('shown_s'), 's', 2)}, {_number(outcome.get('back_s'), 's', 2)}",
    ]


def _must(case: Case) -> str:
    """In words, what the test asserts."""
    bound = f"no valid setpoint is wrong by more than {case.bound_um:g} um"
    if case.lost:
        return f"connections close; {bound}"
    if case.states:
        states = codes(sorted(case.states)).replace(", ", " or ")
        return f"{states}, and the reason names {escape(case.names)}; {bound}"
    if case.way is Way.UNDISTURBED:
        return f"stays `ok`; {bound}"
    if case.way is Way.UNSEEN:
        return f"stays `ok`; {bound}" if not case.at_least_um else "nothing"
    return bound


def _outcome(case: Case) -> dict[str, Any]:
    outcome: dict[str, Any] = measured()["outcomes"].get(case.id, {})
    return outcome


def _share(value: float | None) -> str:
    return _number(None if value is None else 100 * value, "%", 0)


def _number(value: float | None, unit: str, decimals: int) -> str:
    return "-" if value is None or math.isnan(value) else f"{value:.{decimals}f} {unit}"
