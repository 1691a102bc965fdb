"""Median, p99 and largest of measured durations, as one row of a table."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

import structlog
from rich.console import Console
from rich.table import Table


def median_and_p99(values: Sequence[float]) -> tuple[float, float]:
    """Of at least one value."""
    ordered = sorted(values)
    return statistics.median(ordered), ordered[int(0.99 * (len(ordered) - 1))]


def quiet() -> None:
    """No log between the tables."""
    structlog.configure(logger_factory=structlog.ReturnLoggerFactory())


def show(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table; the first column is text, the others are numbers."""
    table = Table(title=title, title_justify="left")
    for i, name in enumerate(header):
        table.add_column(name, justify="right" if i else "left")
    for row in rows:
        table.add_row(*row)
    Console(width=120).print(table)
