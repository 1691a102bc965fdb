"""A comparison of a long recording: its numbers are of all rows; pictures, noise and trends are of a sample."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.column_faults import column_faults
from compd.comparison.comparison import Comparison, Size
from compd.comparison.row_faults import OUTLIER
from compd.comparison.stream.residual_totals import ResidualTotals
from compd.data_fault import DataFault


@dataclass(frozen=True, eq=False, repr=False)
class StreamedComparison(Comparison):
    """A comparison that went through a recording block by block.

    Arrays with a row for each row of a recording have one for each row of the sample. So are the noise floor, the
    trends and the prediction's uncertainty of the sample; every other number is of all rows.

    Attributes
    ----------
    totals : ResidualTotals
        Sums over all rows; `totals.envelope` is the residual over time.
    """

    totals: ResidualTotals

    @classmethod
    def of_sample(cls, comparison: Comparison, totals: ResidualTotals) -> StreamedComparison:
        """The comparison of the sample with the numbers of all rows."""
        values: dict[str, Any] = {column.name: getattr(comparison, column.name) for column in fields(Comparison)}
        values |= {
            "left_out": dict(totals.left_out),
            "contributions": totals.contributions,
            "constant_um": totals.registration_um,
        }
        return cls(**values, totals=totals)

    @cached_property
    def rms_by_axis_um(self) -> FloatArray:
        """(m,) root mean square of each coordinate over all rows used."""
        return self.totals.rms_um

    @cached_property
    def mean_by_axis_um(self) -> FloatArray:
        """(m,) mean of each coordinate over all rows used."""
        return self.totals.mean_um

    @cached_property
    def p95_by_axis_um(self) -> FloatArray:
        """(m,) what 95 % of all rows used stay below, by amount; within 0.05 %, by a histogram."""
        return self.totals.p95_um

    @cached_property
    def largest_by_axis_um(self) -> FloatArray:
        """(m,) the largest amount of each coordinate among all rows used."""
        return np.asarray(self.totals.largest_um)

    @cached_property
    def distance_size(self) -> Size:
        """Of the residual vector's length, over all rows used."""
        return self.totals.distance

    @property
    def rows(self) -> int:
        """Rows of the recording."""
        return self.totals.rows

    @cached_property
    def rows_used(self) -> int:
        """How many rows count."""
        return self.totals.used

    @cached_property
    def outlier_count(self) -> int:
        """How many rows no noise explains."""
        return self.totals.outliers

    @cached_property
    def outlier_rows(self) -> list[int]:
        """The first thousand of these rows, as a spreadsheet shows them."""
        return self.totals.outlier_rows

    @cached_property
    def faults(self) -> tuple[DataFault, ...]:
        """Of the recording as it was read; and the rows that no noise explains."""
        rows = tuple(self.outlier_rows)
        found = DataFault(OUTLIER, rows, (), "far from all else, which no noise explains", "rows left out")
        return (*column_faults(self.aligned), *self.aligned.recording.faults, *([found] if rows else []))

    @property
    def sample_rows(self) -> int:
        """Rows of the sample."""
        return self.aligned.recording.rows

    @property
    def basis(self) -> str:
        """Which numbers rest on the sample, in a sentence."""
        return (
            f"Noise floor, trends, the limits of outliers and the prediction's own uncertainty are from "
            f"{self.sample_rows} rows of {self.rows}, spread evenly; all other numbers are of all rows"
        )

    def as_json(self) -> dict[str, Any]:
        """As of a recording in memory, with what rests on the sample."""
        largest_row = zip(self.aligned.labels, self.totals.largest_row.tolist(), strict=True)
        return {
            **super().as_json(),
            "rows": self.rows,
            "largest_row_xyz": dict(largest_row),
            "outliers_listed": len(self.outlier_rows),
            "sample": {
                "rows": self.sample_rows,
                "numbers": ["noise_floor", "where_it_fails", "prediction_std_um", "outlier_limits"],
            },
        }
