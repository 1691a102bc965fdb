"""The page of the fault matrix: what happens when something fails, as tested and as measured."""

from __future__ import annotations

import math
from typing import Any

import yaml

from docs.generate.fault_cells import Document, figures, introduction, measured, number, overview, results, results_of
from docs.generate.markdown import codes, escape, fence, heading, join, link, table, target
from tests.injection.case import Case, Way
from tests.injection.cells.situation import Situation
from tests.injection.machine import VOTES
from tests.injection.matrix import FAULTS

HEADER = ["what fails", "what must happen, and the way out", "largest error, valid", "shown, `ok` again after"]


def page() -> str:
    """Markdown, from the matrix and from what was measured."""
    return page_of(measured())


def page_of(document: Document) -> str:
    """Markdown, from the matrix and this file of results."""
    groups = list(dict.fromkeys(case.group for case in FAULTS))
    return join(
        "# What happens when ...",
        _introduction(document),
        introduction(document),
        _unseen(document),
        overview(document),
        *(join(heading(2, group, target("faults", group)), _table(group, document)) for group in groups),
    )


def _introduction(document: Document) -> str:
    return f"""\
... a gauge, a line, a process or a client fails. Each row of these tables is a test: it happens to the replies of the
simulated tripod of `config/tripod-cmm.yaml`, or to the daemon, and every setpoint that says `valid` is compared with
the true tip of the machine. All of it runs in virtual time, so that it shows the same every time; what clients do, and
a sample of the others, run with real ports, sockets and processes. The machine stands still, unless a row says that it
drives. Its owner has added to the configuration:

{fence(yaml.safe_dump({"votes": VOTES}), "yaml")}
The columns on the right are from
`{document["command"]}`; those of clients with `--real`:

- *largest error* of any setpoint that was valid, from the beginning of the fault until the state was `ok` again.
  Without any fault it is 0.3 um, the noise of the gauges;
- *valid*: the share of the setpoints that were valid while the fault lasted;
- *shown after*: from the beginning of the fault until state and reason said so; *`ok` again after*: from the end of the
  fault, or from `compd accept`. A dash: there was nothing to measure.

[Limits and stale gauges](../explanation/limits-and-stale-gauges.md) explains the states,
[the daemon's processes](../explanation/processes.md) who guards whom. `tests/system/test_fault_matrix.py` runs the
sample with real parts, and `make worlds` lets faults happen at random.
"""


def _unseen(document: Document) -> str:
    """What no gauge shows, first: it is what a person has to know."""
    rows = [
        [escape(case.fault), escape(case.injected), number(_worst_um(case, document), "um", 1), _spot(case)]
        for case in FAULTS
        if case.unseen
    ]
    return join(
        heading(2, "What nothing shows", target("faults", "unseen")),
        "Each of these gauges is the only one that measures what it measures, and its part may move so; or it is shown "
        "only after a while. Until then the setpoints are valid, and the tip is wrong by as much as the third column "
        "says. `compd check --what-cannot-be-seen` lists them for your machine.",
        table(["what fails", "what was injected", "tip wrong by", "why"], rows),
    )


def _spot(case: Case) -> str:
    """A link to the blind spot that a fault is in."""
    return link(case.unseen.replace("_", " "), target("blind-spots", case.unseen))


def _worst_um(case: Case, document: Document) -> float | None:
    """Of all situations but motion, where most of the error is by the readings' age; if it drives, of that."""
    tried = [r for r in results_of(document, case) if case.drives or r["situation"] != Situation.MOTION.name.lower()]
    found = [result["worst_um"] for result in [_outcome(case, document), *tried]]
    return max((um for um in found if um is not None), default=None)


def _table(group: str, document: Document) -> str:
    header = [HEADER[0], HEADER[1], "error of bound" if results(document) else HEADER[2], HEADER[3]]
    return table(header, [_row(case, document) for case in FAULTS if case.group == group])


def _row(case: Case, document: Document) -> list[str]:
    outcome = _outcome(case, document)
    cells = [figures(result) for result in results_of(document, case)]
    at_once = f"{number(outcome.get('worst_um'), 'um', 2)}, {_share(outcome.get('valid_share'))}"
    seen = f"not seen: {_spot(case)}" if case.unseen else "seen"
    return [
        f"{escape(case.fault)}<br>*{escape(case.injected)}*",
        f"{_must(case)}<br>Way out: {'the service manager starts it again' if case.lost else case.way.value}",
        "<br>".join([seen, *cells]) if cells else at_once,
        f"{number(outcome.get('shown_s'), 's', 2)}, {number(outcome.get('back_s'), 's', 2)}",
    ]


def _must(case: Case) -> str:
    """In words, what the test asserts."""
    if case.unseen:
        return "what the blind spot says"
    allowed = "its bound" if math.isinf(case.bound_um) else f"{case.bound_um:g} um"
    bound = f"no valid setpoint is wrong by more than {allowed}"
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


def _outcome(case: Case, document: Document) -> dict[str, Any]:
    outcome: dict[str, Any] = document["outcomes"].get(case.id, {"worst_um": None})
    return outcome


def _share(value: float | None) -> str:
    return number(None if value is None else 100 * value, "%", 0)
