"""The lines' plan as `compd check` shows it."""

from __future__ import annotations

import math

from rich.console import Console
from rich.table import Table

from compd.commissioning.line_budget import budget_warnings, line_budgets
from compd.configuration import Configuration
from compd.errors import Problem


def print_line_plan(configuration: Configuration) -> list[Problem]:
    """Print bytes, milliseconds and rate per line; the warnings that follow."""
    plans = line_budgets(configuration)
    table = Table(
        "line",
        "gauges",
        "exchanges",
        "bytes",
        "ms a round",
        "ms, 10 ms turnaround",
        "rate, Hz",
        title="What the lines can carry",
        title_justify="left",
    )
    for column in table.columns[1:]:
        column.justify = "right"
    table.columns[-1].no_wrap = True
    for one in plans:
        table.add_row(
            one.name,
            str(one.gauges),
            str(one.exchanges),
            str(one.bytes) if one.known else "?",
            f"{one.ideal_s * 1e3:.1f}" if one.known else "?",
            f"{one.usual_s * 1e3:.1f}" if one.known else "?",
            _rates(one.usual_hz, one.ideal_hz),
        )
    Console().print(table)
    return budget_warnings(configuration, plans)


def _rates(usual_hz: float, ideal_hz: float) -> str:
    return "?" if math.isnan(usual_hz) else f"{usual_hz:.3g} to {ideal_hz:.3g}"
