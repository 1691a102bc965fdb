"""A measurement plan: rows to measure, and how far apart effects will be on them; or what to measure in words."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from compd.instruments import Way
from compd.plan_file import NOT_SET, write_text_file
from compd.planning.plan_formats import DWELL_S, PlanFormat, rows_text
from compd.planning.planning_criteria import PlanningCriteria
from compd.result_tables import Columns, data_frame, html_table
from compd.text import join_words

if TYPE_CHECKING:
    import pandas as pd

# The way on where nothing tells rivals apart.
_EITHER = (
    "Within the limits they correct alike: either may be added to the model and used there. Which of the two it is "
    "stays open."
)
# A smaller one is rounding.
MIN_SHOWN = 0.01
# A column with more values is told by its range.
MAX_VALUES = 4


@dataclass(frozen=True, repr=False)
class MeasurementPlan:
    """Rows to measure, which tell rival effects apart.

    Attributes
    ----------
    rivals : tuple of str
        Ids of the effects, most often two.
    rows : tuple of dict
        One per row: each column of the plan's file and its value; `row`, `purpose` and `time_s` first. Of a machine
        whose kinematics is known the tip's place in {M} `tip_x_mm` ..., the directions in which the links come
        `approach_1` ..., `speed_mm_per_s`, and what is held: loads in N, temperatures in degC. With ``machine:
        external`` the columns of the recording that are to be set.
    separation : float
        By how much the nearest of the rivals will differ from another one on the recording and these rows together, in
        standard deviations of the noise (root of the sum of squares over all rows).
    before : float
        The same on the recording alone.
    separated_by : str
        What tells the rivals apart, in words, should these rows not.
    alike : tuple of pairs of str
        Of three rivals or more, the pairs that no rows within the limits tell apart; the rows are for the others.
    ways : tuple
        For each row the way on which the links come from the wanted side, for G-code; empty where it is not known.
    difference_um : tuple of tuples of float
        By how much two of the rivals, the first that the rows are for, differ on each row, along each measured
        coordinate, as they are fitted on the recording; empty where there is one alone.
    criteria : PlanningCriteria
        By how much the rivals have to differ.
    """

    rivals: tuple[str, ...]
    rows: tuple[dict[str, Any], ...]
    separation: float
    before: float
    separated_by: str = ""
    alike: tuple[tuple[str, str], ...] = ()
    ways: tuple[Way | None, ...] = ()
    difference_um: tuple[tuple[float, ...], ...] = ()
    criteria: PlanningCriteria = PlanningCriteria()

    @property
    def is_wide_enough(self) -> bool:
        """Whether the rivals will differ by `min_separation` of the criteria or more, whatever they did before."""
        return self.separation >= self.criteria.min_separation

    @property
    def tells_apart(self) -> bool:
        """Whether the rivals will differ by three standard deviations or more, by one more than before.

        The two numbers are those of the criteria.
        """
        return self.is_wide_enough and self.separation - self.before >= self.criteria.min_gain

    @property
    def summary(self) -> str:
        """What the rows are good for, in a sentence or two."""
        except_alike = ", but for those named below," if self.alike and self.rows else ""
        verb, by = ("differ", "by ") if len(self.rivals) > 1 else ("is", "")
        errors = "The errors" if len(self.rivals) > 1 else "The error"
        least = f"{by}at least " if len(self.rivals) > 2 else by
        enough = f"; {self.criteria.min_separation:.2g} times is enough" if self.is_wide_enough else ""
        text = (
            f"{errors} from {join_words(self.rivals, 'and')}{except_alike} {verb} {least}{as_factor(self.before)} "
            f"times the measurement's noise in the rows so far, and {least}{as_factor(self.separation)} times with "
            f"these {len(self.rows)} rows{enough}."
        )
        if self.alike:
            pairs = join_words([f"{first} from {second}" for first, second in self.alike], "or")
            text += f" No rows within the limits tell {pairs}. {_EITHER}"
        if self.tells_apart:
            return text
        if self.separation < MIN_SHOWN:
            return f"{text} One of them does nothing on such rows that the other, a constant or the model does not do."
        if not self.is_wide_enough:
            text += f" That does not tell them apart, which takes {self.criteria.min_separation:.2g} times."
        else:
            text += " These rows add little."
        text += f" Widen the limits, or measure otherwise: {self.separated_by}."
        return text if self.is_wide_enough or self.alike else f"{text} {_EITHER}"

    @property
    def instructions(self) -> str:
        """What to set, in a sentence: "Set elevation_deg from 20 to 85; moved_1 to -1 or 1."."""
        varied, held = [], []
        for name in self._columns():
            values = np.unique([row[name] for row in self.rows]) if name not in NOT_SET else np.zeros(0)
            if len(values) == 1:
                held.append(f"{name} at {values[0]:g}")
            elif len(values) > MAX_VALUES:
                varied.append(f"{name} from {values[0]:g} to {values[-1]:g}")
            elif len(values):
                varied.append(f"{name} to {', '.join(f'{value:g}' for value in values[:-1])} or {values[-1]:g}")
        parts = [f"set {', '.join(varied)}"] * bool(varied) + [f"hold {', '.join(held)}"] * bool(held)
        if any(row["time_s"] > 0 for row in self.rows):
            parts.append("keep to the times time_s, which count from the start of each programme")
        text = "; ".join(parts)
        return f"{text[:1].upper()}{text[1:]}."

    def text(self, format: PlanFormat = "plan", feed_mm_per_min: float | None = None, dwell_s: float = DWELL_S) -> str:
        """The text of the file that `write` writes, with the same parameters."""
        title = f"{', '.join(self.rivals)}; {len(self.rows)} rows"
        return rows_text(self.rows, format, title, self.ways, feed_mm_per_min, dwell_s)

    def write(
        self,
        path: str | Path,
        format: PlanFormat = "plan",
        feed_mm_per_min: float | None = None,
        dwell_s: float = DWELL_S,
    ) -> None:
        """Write the rows, for a person at the machine, for `compd sim run --plan`, or for instrument and controller.

        Parameters
        ----------
        path : str or Path
            Where to; an existing file is replaced.
        format : str
            ``"plan"``: CSV, as `compd sim run --plan` reads it. Targets for the instrument, named P001 ...: ``"sa"``
            (SpatialAnalyzer ASCII) or ``"csv"``. ``"gcode"``: a programme for the controller.
        feed_mm_per_min, dwell_s : float
            For G-code: the feed between places, which is needed, and the time at rest at each.

        Raises
        ------
        CompdError
            For G-code without a feed, or targets of a plan that has no places of the tip.
        RecordingError
            Where the file cannot be written.
        """
        write_text_file(Path(path), self.text(format, feed_mm_per_min, dwell_s))

    def to_dataframe(self) -> pd.DataFrame:
        """The rows, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            One row per row to measure, with the columns of the file; nan where nothing is to be set.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns())

    def _repr_html_(self) -> str:
        return html_table(self.summary, self._columns())

    def __repr__(self) -> str:
        return f"<MeasurementPlan: {self.summary}>"

    def _columns(self) -> Columns:
        names = dict.fromkeys(name for row in self.rows for name in row)
        return {name: [row.get(name, np.nan) for row in self.rows] for name in names}


@dataclass(frozen=True)
class NextMeasurement:
    """What to measure next about some effects: rows, or in words what would do where no rows within the limits do.

    effects : ids of the effects.
    plan : the rows with what they are worth; None where none within the limits are worth measuring.
    measure, why : what to measure in words, and why there are no rows; "" where there are rows.
    """

    effects: tuple[str, ...]
    plan: MeasurementPlan | None = None
    measure: str = ""
    why: str = ""

    @property
    def promise(self) -> str:
        """What the rows will do; or that there are none, and what would do: a sentence."""
        if self.plan is not None:
            what = "these differ by" if len(self.effects) > 1 else "it is seen at"
            return f"The rows under 'next' can: with them {what} {as_factor(self.plan.separation)} times the noise."
        return f"No rows within the limits of this recording can: {self.why}. What can: {self.measure}."

    def as_json(self) -> list[dict[str, Any]]:
        """The rows; or one entry with `measure` and `why`."""
        if self.plan is not None:
            return [dict(row) for row in self.plan.rows]
        return [{"measure": self.measure, "why": self.why}]


def as_factor(separation: float) -> str:
    """A number of standard deviations as people read it: "18", "1.6", "0"."""
    if separation >= 10:
        return f"{separation:.0f}"
    return f"{separation:.2g}" if separation >= MIN_SHOWN else "0"
