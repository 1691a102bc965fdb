"""The page of what compd cannot see, from the list in the code, with the numbers of the shipped tripod."""

from __future__ import annotations

from functools import cache

from compd.commissioning import BLIND_SPOTS, DRIFT_UM, figures_of, shown_by
from compd.commissioning.blind_spots import BlindSpot
from compd.commissioning.fault_costs import Figures
from compd.configuration import load_machine
from docs.generate import fault_cells
from docs.generate.markdown import code, escape, heading, join, sentence, table, target
from tests.injection.matrix import FAULTS

INTRODUCTION = """\
A gauge that is lost says so; one that is wrong does not. compd compares what it can: a reading with the ones before it,
a value that comes back with the last good one, gauges with each other. What then remains looks like a good machine, and
a wrong setpoint is published as valid. This page lists it, with what it costs at the tip.

The numbers are those of the tripod that comes with compd. For your own machine:

    compd check --what-cannot-be-seen my-machine.yaml

`votes.KEY` is a key of the section [`votes`](#configuration-votes) of the configuration. That command also says whether
it is on.
"""
DRIFT = f"""\
The error at the tip, at machine zero, of a length that is wrong by {DRIFT_UM:g} um: in CMM mode of the tip that is
published, in machine-tool mode of the place to which the machine is sent.
"""


@cache
def figures() -> Figures:
    """Of the shipped tripod."""
    return figures_of(load_machine("tripod-cmm"))


def page() -> str:
    """Markdown, from the list of blind spots, the kinematics and what was measured."""
    return page_of(fault_cells.measured())


def page_of(document: fault_cells.Document) -> str:
    """Markdown, with this file of results."""
    drifts = [[d.length, code(d.gauge), f"{d.cmm_um:.1f}", f"{d.machine_tool_um:.1f}"] for d in figures().drifts]
    return join(
        "# What compd cannot see",
        INTRODUCTION,
        *(_part(spot, document) for spot in BLIND_SPOTS),
        heading(2, f"What a drift of {DRIFT_UM:g} um costs", "blind-spots-drift"),
        DRIFT,
        table(["length", "gauge", "CMM mode, um", "machine-tool mode, um"], drifts),
    )


def _tried(spot: BlindSpot, document: fault_cells.Document) -> str:
    """What was injected for it, and how wrong a valid setpoint was; "" where that has not been measured."""
    tried = [
        f"{case.injected}: " + ", ".join(map(fault_cells.figures, found))
        for case in FAULTS
        if case.unseen == spot.name and (found := fault_cells.results_of(document, case))
    ]
    return "; ".join(tried) + " (the tip's error, of the bound that the setpoint states)" if tried else ""


def _part(spot: BlindSpot, document: fault_cells.Document) -> str:
    """One blind spot: a heading and a list."""
    points = [
        ("Shown by", escape(sentence(shown_by(spot)))),
        ("Unseen", escape(sentence(spot.unseen))),
        ("On this tripod", escape(sentence(spot.cost(figures())) if spot.cost(figures()) else "")),
        ("Measured", escape(_tried(spot, document))),
    ]
    title = spot.fault[0].upper() + spot.fault[1:]
    items = "".join(f"- *{name}:* {text}\n" for name, text in points if text)
    return join(heading(2, escape(title), target("blind-spots", spot.name)), items)
