"""The numbers by which data are told to be wrong as a recording is read, each with its meaning, unit and reason."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold

_STEPS = "robust standard deviations of the steps"


@dataclass(frozen=True)
class FaultCriteria:
    """Which cells of quantities and which rows of the reference are no measurement."""

    min_values: int = threshold(
        12,
        unit="values",
        meaning="a column with fewer known values is not judged",
        reason="a choice: fewer say nothing of each other",
    )
    neighbours: int = threshold(
        7,
        unit="rows",
        meaning="so many rows around a value have the median by which it is judged",
        reason="it holds against two wild ones in a row",
    )
    min_step_sigmas: float = threshold(
        20.0,
        unit=_STEPS,
        meaning="a jump there and back of a temperature, a pressure or a humidity is wild only beyond this",
        reason="a choice: four times what makes a row gross, as a quantity may be driven",
    )
    min_range_share: float = threshold(
        0.5,
        unit="share of the range of the others (5 to 95 %)",
        meaning="and only beyond this",
        reason="a choice: less is what the quantity does in any case",
    )
    max_wild_share: float = threshold(
        0.02,
        unit="share of the rows",
        meaning="more jumps there and back are what happened, and no wild values",
        reason="a choice: a loose contact is rarer",
    )
    min_ranges_slow: float = threshold(
        3.0,
        unit="ranges of all others",
        meaning="a number of a slow quantity, or one that devices write for no reading, is wild from so far away",
        reason="a choice: three times as far as all that it ever was",
    )
    min_ranges: float = threshold(
        10.0,
        unit="ranges of all others",
        meaning="the same of any other number",
        reason="a choice: a load that is put on once may be far from others",
    )
    max_sentinel_share: float = threshold(
        0.3,
        unit="share of the rows",
        meaning="a number in more rows is no missing reading",
        reason="a choice: it is a state of the machine then",
    )
    min_different: int = threshold(
        10,
        unit="values",
        meaning="so many of the others must differ for a number to be wild among them",
        reason="a choice: settings repeat their numbers, readings do not",
    )
    min_different_share: float = threshold(
        0.2,
        unit="share of the others",
        meaning="and so many of them",
        reason="the same",
    )
    min_hanging_rows: int = threshold(
        12,
        unit="rows",
        meaning="a gauge with the same digits in fewer rows does not hang",
        reason="a choice: a short stop of the machine looks alike",
    )
    max_hanging_chance: float = threshold(
        1e-9,
        unit="probability",
        meaning="a gauge hangs where chance repeats its digits so long more rarely",
        reason="a choice: in no recording by chance, of any number of columns",
    )
    min_changing: float = threshold(
        0.5,
        unit="share of the other rows",
        meaning="a column of which the digits change more rarely is not told to hang",
        reason="a choice: a coarse display stands still most of the time",
    )
    min_jump: float = threshold(
        4.0,
        unit="usual steps (95 %)",
        meaning="a gauge that hung comes back with a larger jump, and a wild value is reached by one",
        reason="a choice: what stands while a slow thing turns goes on without one",
    )
    place_mm: float = threshold(
        0.1,
        unit="mm",
        meaning="places that are farther apart are told apart by every reference",
        reason="a caliper shows a fifth of it",
    )
    min_digits: float = threshold(
        10.0,
        unit="last digits",
        meaning="two readings that are farther apart are of two places",
        reason="a choice: more than any display flickers",
    )
    min_sigmas: float = threshold(
        20.0,
        unit="robust standard deviations of what the model misses",
        meaning="and only beyond this",
        reason="a choice: four times what makes a row gross",
    )
    min_unfollowed_mm: float = threshold(
        1.0,
        unit="mm",
        meaning="a standing machine with a reference that moves by more is a column that was not recorded any more",
        reason="less, an effect can make",
    )
    max_share: float = threshold(
        0.8,
        unit="share of the rows",
        meaning="a column that holds one number in more of them is constant",
        reason="a choice: it was not meant to change",
    )
    min_run: int = threshold(
        3,
        unit="rows",
        meaning="fewer rows of one axis with the same digits happen by chance",
        reason="a choice: two do with every coarse display",
    )


LIMITS = FaultCriteria()
