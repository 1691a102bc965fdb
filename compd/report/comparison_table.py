"""The numbers of one or more comparisons as a table, for a terminal and for the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import rms
from compd.comparison import Comparison
from compd.display_unit import format_error
from compd.report.page_table import PageTable
from compd.text import number_text


def summary(comparisons: Sequence[Comparison]) -> PageTable:
    """Numbers of every recording side by side."""
    head = ["", *(name_of(comparison) for comparison in comparisons)]
    rows: list[list[str]] = [
        ["residual, rms per coordinate", *(_shown(comparison, comparison.rms_um) for comparison in comparisons)],
        ["noise floor", *(_floor(comparison) for comparison in comparisons)],
        ["floor ratio, 1 = at the floor", *(f"{comparison.floor_ratio:.3g}" for comparison in comparisons)],
    ]
    labels = list(dict.fromkeys(label for comparison in comparisons for label in comparison.aligned.labels))
    rows += [
        [f"{label}: rms / 95 % / largest", *(_axis(comparison, label) for comparison in comparisons)]
        for label in labels
    ]
    if any(comparison.aligned.registration_columns.size for comparison in comparisons):
        rows.append(
            [f"constant taken off, {' / '.join(labels)}", *(_constant(comparison) for comparison in comparisons)]
        )
    rows.append(["distance in 3D: rms / 95 % / largest", *(_distance(comparison) for comparison in comparisons)])
    contributions = list(dict.fromkeys(name for comparison in comparisons for name in comparison.contributions))
    rows += [
        [f"rms without {name}", *(_without(comparison, name) for comparison in comparisons)] for name in contributions
    ]
    rows += [
        ["prediction's own uncertainty", *(_uncertainty(comparison) for comparison in comparisons)],
        ["rows used", *(str(comparison.rows_used) for comparison in comparisons)],
        ["rows beyond all noise", *(str(comparison.outlier_count) for comparison in comparisons)],
        ["rows left out", *(str(sum(comparison.left_out.values())) for comparison in comparisons)],
    ]
    return PageTable(head, rows)


def name_of(comparison: Comparison) -> str:
    """The recording's file, with its folder: `train.csv` alone says nothing."""
    path = comparison.aligned.recording.path.resolve()
    return f"{path.parent.name}/{path.name}"


def no_trend_text(comparison: Comparison) -> str:
    """The text for a residual without any straight-line relation."""
    if comparison.at_floor:
        return "nowhere: what is left is noise"
    return "no straight line in anything measured explains what is left; look at the pictures for bends and steps"


def _shown(comparison: Comparison, value_um: float) -> str:
    """A value with three figures in the unit of the recording."""
    return format_error(value_um, comparison.aligned.unit, 3)


def _three(value: float) -> str:
    """A value with three figures, including trailing zeros."""
    return number_text(value, digits=3)


def _floor(comparison: Comparison) -> str:
    return f"{_shown(comparison, comparison.floor.um)} ({comparison.floor.source})"


def _axis(comparison: Comparison, label: str) -> str:
    if label not in comparison.aligned.labels:
        return "-"
    k = comparison.aligned.labels.index(label)
    largest = format_error(float(comparison.largest_by_axis_um[k]), comparison.aligned.unit_of(label), 3)
    return f"{_three(comparison.rms_by_axis_um[k])} / {_three(comparison.p95_by_axis_um[k])} / {largest}"


def _constant(comparison: Comparison) -> str:
    """The constant of each coordinate that was fitted along; "-" for a machine in its own frame."""
    if not comparison.aligned.registration_columns.size:
        return "-"
    return " / ".join(map(_three, comparison.constant_um)) + f" {comparison.aligned.unit}"


def _distance(comparison: Comparison) -> str:
    if comparison.aligned.of_links or len(comparison.aligned.labels) < 3:
        return "-"
    size = comparison.distance_size
    return f"{_three(size.rms_um)} / {_three(size.p95_um)} / {_shown(comparison, size.largest_um)}"


def _without(comparison: Comparison, name: str) -> str:
    without = comparison.contributions.get(name)
    return "-" if without is None else _shown(comparison, without.without_rms_um)


def _uncertainty(comparison: Comparison) -> str:
    total = rms(comparison.uncertainty.total_um[comparison.used])
    return "not known" if np.isnan(total) else format_error(total, comparison.aligned.unit)
