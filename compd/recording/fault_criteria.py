"""The numbers by which data are told to be wrong as a recording is read, each with its meaning, unit and reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FaultCriteria:
    """Which cells of quantities and which rows of the reference are no measurement."""

    min_values: int = 12
    """values | a column with fewer known values is not judged | a choice: fewer say nothing of each other"""
    neighbours: int = 7
    """rows | so many rows around a value have the median by which it is judged | it holds against two wild ones in a
    row"""
    min_step_sigmas: float = 20.0
    """robust standard deviations of the steps | a jump there and back of a temperature, a pressure or a humidity is
    wild only beyond this | a choice: four times what makes a row gross, as a quantity may be driven"""
    min_range_share: float = 0.5
    """share of the range of the others (5 to 95 %) | and only beyond this | a choice: less is what the quantity does in
    any case"""
    max_wild_share: float = 0.02
    """share of the rows | more jumps there and back are what happened, and no wild values | a choice: a loose contact
    is rarer"""
    min_ranges_slow: float = 3.0
    """ranges of all others | a number of a slow quantity, or one that devices write for no reading, is wild from so far
    away | a choice: three times as far as all that it ever was"""
    min_ranges: float = 10.0
    """ranges of all others | the same of any other number | a choice: a load that is put on once may be far from
    others"""
    max_sentinel_share: float = 0.3
    """share of the rows | a number in more rows is no missing reading | a choice: it is a state of the machine then"""
    min_different: int = 10
    """values | so many of the others must differ for a number to be wild among them | a choice: settings repeat their
    numbers, readings do not"""
    min_different_share: float = 0.2
    """share of the others | and so many of them | the same"""
    min_hanging_rows: int = 12
    """rows | a gauge with the same digits in fewer rows does not hang | a choice: a short stop of the machine looks
    alike"""
    max_hanging_chance: float = 1e-9
    """probability | a gauge hangs where chance repeats its digits so long more rarely | a choice: in no recording by
    chance, of any number of columns"""
    min_changing: float = 0.5
    """share of the other rows | a column of which the digits change more rarely is not told to hang | a choice: a
    coarse display stands still most of the time"""
    min_jump: float = 4.0
    """usual steps (95 %) | a gauge that hung comes back with a larger jump, and a wild value is reached by one | a
    choice: what stands while a slow thing turns goes on without one"""
    place_mm: float = 0.1
    """mm | places that are farther apart are told apart by every reference | a caliper shows a fifth of it"""
    min_digits: float = 10.0
    """last digits | two readings that are farther apart are of two places | a choice: more than any display flickers"""
    min_sigmas: float = 20.0
    """robust standard deviations of what the model misses | and only beyond this | a choice: four times what makes a
    row gross"""
    min_unfollowed_mm: float = 1.0
    """mm | a standing machine with a reference that moves by more is a column that was not recorded any more | less, an
    effect can make"""
    max_share: float = 0.8
    """share of the rows | a column that holds one number in more of them is constant | a choice: it was not meant to
    change"""
    min_run: int = 3
    """rows | fewer rows of one axis with the same digits happen by chance | a choice: two do with every coarse
    display"""


LIMITS = FaultCriteria()
