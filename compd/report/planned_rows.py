"""Planned rows as a readable table: every row once, varying columns only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

from compd.plan_file import PURPOSE_COLUMN
from compd.report.page_table import PageTable

Row = Mapping[str, Any]

_APPROACH = "approach_"
# Suffixes of columns that are units, the longer ones first.
_UNITS = ("mm_per_s", "degC", "deg", "rad", "pct", "mm", "um", "N", "s")


def planned_rows_table(rows: Sequence[Row]) -> PageTable:
    """The rows of a plan with their numbers of repeats; the caption has the constant columns."""
    counted = _counted([_with_one_approach(row) for row in rows])
    names = list(dict.fromkeys(name for row, _ in counted for name in row))
    texts = {name: _column_texts([row.get(name, "") for row, _ in counted]) for name in names}
    constant = [name for name in names if len(set(texts[name])) == 1 and name != PURPOSE_COLUMN]
    changing = [name for name in names if name not in constant]
    head = [_head(name) for name in changing]
    columns = [texts[name] for name in changing]
    if any(count > 1 for _, count in counted):
        head.append("times")
        columns.append([str(count) for _, count in counted])
    # a time of 0 everywhere is omitted: no row waits for another
    held = [f"{_head(name)} {texts[name][0]}" for name in constant if (name, texts[name][0]) != ("time_s", "0")]
    caption = f"The same in every row: {'; '.join(held)}." if held else ""
    return PageTable(head, list(zip(*columns, strict=True)), caption)


def _with_one_approach(row: Row) -> dict[str, Any]:
    """The row without its number, and with the directions of all links in one cell."""
    kept = {name: value for name, value in row.items() if name != "row" and not name.startswith(_APPROACH)}
    signs = [f"{int(value):+d}" if value else "0" for name, value in row.items() if name.startswith(_APPROACH)]
    if signs:
        kept["approach"] = " ".join(signs)
    return kept


def _counted(rows: Sequence[dict[str, Any]]) -> list[tuple[dict[str, Any], int]]:
    """Each row with its count: in any order if no row waits for another, else in sequence."""
    if any(row.get("time_s", 0) for row in rows):
        return [(row, len(list(same))) for row, same in groupby(rows)]
    different: list[dict[str, Any]] = []
    for row in rows:
        if row not in different:
            different.append(row)
    return [(row, rows.count(row)) for row in different]


def _column_texts(values: Sequence[Any]) -> list[str]:
    """Numbers of one column with equal decimals, as many as the finest needs."""
    if any(isinstance(value, str) for value in values):
        return [str(value) for value in values]
    decimals = max(len(f"{value:.3f}".rstrip("0").partition(".")[2]) for value in values)
    return [f"{value + 0.0:.{decimals}f}" for value in values]


def _head(name: str) -> str:
    """A column's name as people write it: "tip x, mm"."""
    unit = next((unit for unit in _UNITS if name.endswith(f"_{unit}")), "")
    stem = name.removesuffix(f"_{unit}") if unit else name
    return f"{stem.replace('_', ' ')}, {unit.replace('_per_', '/')}" if unit else name
