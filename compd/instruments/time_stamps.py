"""Stamps of date and time as programs write them, as seconds; and times coarser than the rows, spread.

Known are ISO 8601, "02/12/2025 04:56:08 PM", "12.02.2025 16:56:08", two-digit years, fractions with a point or a comma,
zones, and the time of day alone. The order of day and month is never guessed.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.tables import ProblemList, rows_text

DATE_ORDERS = ("dmy", "mdy", "ymd")
DAY_S = 86400.0
# Step (s) of a clock in autumn, and the longest interval (s) of the rows around it.
SET_BACK_S = 3600.0
_MAX_PAUSE_S = 600.0
# Two-digit years from here on are of the last century, as POSIX has it.
_CENTURY = 69
_ONE_DATE = "all rows of one date"
_DATE = r"(?:(\d{1,4})([-./])(\d{1,2})\2(\d{1,4}))"
_CLOCK = r"(?:(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?\s?([AaPp]\.?[Mm]\.?)?\s?(Z|UTC|[-+]\d{2}:?\d{2})?)"
_STAMP = re.compile(rf"{_DATE}?(?:(?<=\d)(?:T|,? +)(?=\d))?{_CLOCK}?", re.ASCII)
_ANY_DATE, _ANY_CLOCK = re.compile(_DATE, re.ASCII), re.compile(_CLOCK, re.ASCII)
_ENDING = re.compile(r"(?:\s?[AaPp]\.?[Mm]\.?)?(?:\s?(?:Z|UTC|[-+]\d{2}:?\d{2}))?$", re.ASCII)
# A line that is not seconds with at most nine decimals.
_NO_SECONDS = re.compile(r"^(?![0-5]\d(?:[.,]\d{1,9})?$)", re.ASCII | re.MULTILINE)

DateKey = tuple[str, str, str, str]


@dataclass(frozen=True)
class StampedTime:
    """Times in seconds."""

    time_s: FloatArray  #: (N,); nan where a cell is empty
    std_s: float  #: standard uncertainty of one, for its coarse resolution
    assumed: str  #: in words, what was found


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date, a time of day, or both."""
    return is_date(cell) or is_clock(cell) or (":" in cell and _STAMP.fullmatch(cell) is not None)


def is_date(cell: str) -> bool:
    """Whether a cell is a date alone."""
    return _ANY_DATE.fullmatch(cell) is not None


def is_clock(cell: str) -> bool:
    """Whether a cell is a time of day alone."""
    return _ANY_CLOCK.fullmatch(cell) is not None


def read_stamps(
    cells: Sequence[str], line: IntArray, dates: str | None, what: str, problems: ProblemList
) -> StampedTime:
    """The times that stamps say, from the midnight before the first of them, or of the day where they have no date.

    A problem is added for each cell that is no stamp, and where the order of day and month cannot be told.

    line : (N,) of the cells. dates : one of DATE_ORDERS, where a person said it. what : for a person, the column.
    """
    parsed = _Parsed(cells, line, what, problems)
    if parsed.failed:
        return StampedTime(np.full(len(cells), np.nan), np.nan, "")
    assumed = []
    time_s = parsed.second_s
    if parsed.dates:
        order, why = _order(parsed, dates, problems)
        if not order:
            return StampedTime(np.full(len(cells), np.nan), np.nan, "")
        days = np.array([_ordinal(key, order) or 0 for key in parsed.dates], dtype=np.float64)
        used = parsed.date[parsed.date >= 0]
        first = int(days[used].min())
        time_s = time_s + np.where(parsed.date >= 0, days[parsed.date] - first, np.nan) * DAY_S
        # of one date that reads as several days, none is named
        begin = "midnight" if why == _ONE_DATE else f"{date.fromordinal(first)} 00:00"
        assumed += [f"dates {_order_text(order)}, {why}" if why != _ONE_DATE else why, f"seconds from {begin}"]
    else:
        time_s, midnights = _past_midnight(time_s)
        assumed.append("time of day" + (f", past midnight {midnights} times" if midnights else ""))
    if parsed.zones:
        assumed.append("in UTC")
    resolution_s = 10.0**-parsed.decimals
    time_s, std_s, spread = spread_within(time_s, resolution_s, whole=parsed.decimals == 0)
    if spread:
        assumed.append(spread)
    return StampedTime(time_s, std_s, "; ".join(assumed))


def spread_within(time_s: FloatArray, resolution_s: float, whole: bool = False) -> tuple[FloatArray, float, str]:
    """(times, their standard uncertainty, in words) of stamps that several rows share, spread within the resolution.

    The k-th of n rows with one stamp t gets t + (k + 1/2) / n resolutions. Where a measurement begins or ends within a
    stamp, the rows have the distance of those in the stamp beside it. A stamp that is cut off says no more than a
    rectangular distribution of the width of the resolution does (GUM 4.3.7).

    whole : spread also where no two rows share a stamp, as for stamps of whole seconds.
    """
    repeated = bool(np.any(time_s[1:] == time_s[:-1]))
    if not len(time_s) or not (repeated or whole):
        return time_s, 0.0, ""
    begins = np.flatnonzero(np.concatenate([[True], time_s[1:] != time_s[:-1]]))
    counts = np.diff(np.append(begins, len(time_s)))
    place = np.arange(len(time_s)) - np.repeat(begins, counts)
    beside = np.abs(np.diff(time_s[begins]) - resolution_s) < 0.01 * resolution_s
    goes_on, went_on = np.append(beside, False), np.append(False, beside)
    room = counts.copy()
    room = np.where(goes_on & ~went_on, np.maximum(counts, np.roll(counts, -1)), room)
    room = np.where(went_on & ~goes_on, np.maximum(counts, np.roll(counts, 1)), room)
    late = np.where(goes_on & ~went_on, room - counts, 0)
    spread_s = time_s + (place + 0.5 + np.repeat(late, counts)) / np.repeat(room, counts) * resolution_s
    most = int(counts.max())
    std_s = float(resolution_s / np.sqrt(12.0))
    words = "whole seconds" if resolution_s == 1.0 else f"stamps of {resolution_s:g} s"
    rows = f"up to {most} rows in each, spread within" if most > 1 else "one row in each"
    assumed = f"{words}, {rows}: +- {std_s:.2g} s"
    return spread_s, std_s, assumed


def set_back_at(time_s: FloatArray) -> int | None:
    """The row from which on times (N,) are an hour too early, as a clock that was set back says them; None for none.

    That is: they fall once, by an hour less a pause, and rise everywhere else. Rows without a time (nan) do not count.
    """
    rows = np.flatnonzero(~np.isnan(time_s))
    steps_s = np.diff(time_s[rows])
    falls = np.flatnonzero(steps_s < 0)
    if len(falls) != 1 or not -SET_BACK_S <= steps_s[falls[0]] <= _MAX_PAUSE_S - SET_BACK_S:
        return None
    return int(rows[falls[0] + 1])


def check_rising(time_s: FloatArray, line: IntArray, next_step: str, problems: ProblemList) -> bool:
    """Whether times (N,), without nan, rise; else a problem or a question is added.  line : (N,)."""
    not_rising = 1 + np.flatnonzero(np.diff(time_s) <= 0)
    set_back = set_back_at(time_s)
    if set_back is not None:
        problems.ask(
            "the clock was set back by an hour (end of summer time?)",
            f"{-np.diff(time_s)[set_back - 1]:.3f} s earlier than the row above",
            ["--clock-set-back (the rows from here on get an hour more)"],
            int(line[set_back]),
        )
    elif len(not_rising):
        lines = line[not_rising].tolist()
        what = f"time does not rise ({rows_text(lines, 'line')})"
        problems.add(lines[0], what, allowed="later than the row above", next_step=next_step)
    return set_back is None and not len(not_rising)


class _Parsed:
    """Stamps taken apart.

    Attributes
    ----------
    date : (N,) index into `dates`, -1 for none. dates : different dates as written. second_s : (N,) of the day, in UTC
    where there are zones. decimals : of the seconds, the most. failed : whether a problem was added.
    """

    def __init__(self, cells: Sequence[str], line: IntArray, what: str, problems: ProblemList) -> None:
        self.dates: dict[DateKey, int] = {}
        self.line_of_date: list[int] = []
        self.decimals = 0
        self.zones = False
        self.failed = False
        self.date = np.zeros(0, dtype=np.int64)
        self.second_s = np.zeros(0)
        # stamps of whole seconds are few
        quick = self._parse_minutes(cells, line) if 2 * len(set(cells)) > len(cells) else None
        wrong = self._parse_each(cells, line) if quick is None else quick
        for i in wrong[:3]:
            more = f" ({len(wrong)} cells like this)" if len(wrong) > 1 else ""
            problems.add(
                int(line[i]),
                f"{what} is no time{more}",
                cells[i],
                "e.g. 2025-02-12 16:56:08.25, 12.02.2025 16:56:08 or 16:56:08",
                "mend or delete the line",
            )
        filled = ~np.isnan(self.second_s)
        without = np.flatnonzero(filled & (self.date < 0)).tolist()
        if self.dates and len(without) and not wrong:
            problems.add(int(line[without[0]]), f"{what} has no date, where others have one", cells[without[0]])
            self.failed = True
        if self.zones and not wrong and quick is None:
            bare = [i for i in np.flatnonzero(filled).tolist() if not _has_zone(cells[i])]
            if bare:
                problems.add(int(line[bare[0]]), f"{what} has no zone, where others have one", cells[bare[0]])
                self.failed = True
        self.failed = self.failed or bool(wrong)

    def _parse_minutes(self, cells: Sequence[str], line: IntArray) -> list[int] | None:
        """As `_parse_each`, but each minute once: a million stamps with fractions share few. None if this cannot be
        done, as the cells do not all end in seconds and one zone."""
        ending = _ENDING.search(cells[0])
        behind = ending[0] if ending else ""
        if behind and not all(cell.endswith(behind) for cell in cells):
            return None
        parts = [cell.removesuffix(behind).rpartition(":") for cell in cells]
        seconds = [part[2] for part in parts]
        if _NO_SECONDS.search("\n".join(seconds)):
            return None
        known: dict[str, tuple[int, float] | None] = {}
        for i, part in enumerate(parts):
            if part[0] not in known:
                known[part[0]] = self._parse(f"{part[0]}:00{behind}", int(line[i]))
        if None in known.values():
            self.dates.clear()
            self.line_of_date.clear()
            return None
        values = [known[part[0]] for part in parts]
        self.date = np.array([value[0] for value in values if value], dtype=np.int64)
        minute_s = np.array([value[1] for value in values if value], dtype=np.float64)
        second_s = list(map(float, "\n".join(seconds).replace(",", ".").split("\n")))
        self.second_s = minute_s + np.array(second_s, dtype=np.float64)
        self.decimals = max(0, max(map(len, seconds)) - 3)
        return []

    def _parse_each(self, cells: Sequence[str], line: IntArray) -> list[int]:
        """Read each different cell; returns the places of those that are no stamps."""
        known: dict[str, tuple[int, float] | None] = {"": (-1, np.nan)}
        for i, cell in enumerate(cells):
            if cell not in known:
                known[cell] = self._parse(cell, int(line[i]))
        values = list(map(known.__getitem__, cells))
        self.date = np.array([-1 if value is None else value[0] for value in values], dtype=np.int64)
        self.second_s = np.array([np.nan if value is None else value[1] for value in values], dtype=np.float64)
        return [i for i, value in enumerate(values) if value is None]

    def _parse(self, cell: str, line: int) -> tuple[int, float] | None:
        match = _STAMP.fullmatch(cell)
        if match is None:
            return None
        first, mark, middle, last, hour, minute, second, fraction, half, zone = match.groups()
        if hour is None:
            return None
        hours, minutes, seconds = int(hour), int(minute), int(second)
        if half is not None:
            if not 1 <= hours <= 12:
                return None
            hours = hours % 12 + (12 if half[0] in "Pp" else 0)
        if hours > 23 or minutes > 59 or seconds > 59:
            return None
        value_s = 3600.0 * hours + 60.0 * minutes + seconds
        if fraction is not None:
            value_s += float("0." + fraction)
            self.decimals = max(self.decimals, len(fraction))
        if zone is not None:
            self.zones = True
            if zone not in ("Z", "UTC"):
                shift_s = 3600.0 * int(zone[1:3]) + 60.0 * int(zone[-2:])
                value_s -= shift_s if zone[0] == "+" else -shift_s
        if first is None:
            return -1, value_s
        key = (first, mark, middle, last)
        place = self.dates.get(key)
        if place is None:
            place = self.dates[key] = len(self.dates)
            self.line_of_date.append(line)
        return place, value_s


def _has_zone(cell: str) -> bool:
    match = _STAMP.fullmatch(cell)
    return match is not None and match[10] is not None


def _ordinal(key: DateKey, order: str) -> int | None:
    """The day's ordinal where a date reads so in this order; None if there is no such day."""
    first, _, middle, last = key
    parts = dict(zip(order, (first, middle, last), strict=True))
    if len(parts["d"]) > 2 or len(parts["m"]) > 2 or len(parts["y"]) not in (2, 4):
        return None
    year = int(parts["y"])
    if len(parts["y"]) == 2:
        year += 1900 if year >= _CENTURY else 2000
    try:
        return date(year, int(parts["m"]), int(parts["d"])).toordinal()
    except ValueError:
        return None


def _order(parsed: _Parsed, wanted: str | None, problems: ProblemList) -> tuple[str, str]:
    """(order, how it is known); ("", "") where it cannot be told, with a problem."""
    keys = list(parsed.dates)
    possible = [order for order in DATE_ORDERS if all(_ordinal(key, order) is not None for key in keys)]
    if wanted is not None:
        if wanted in possible:
            return wanted, "given"
        wrong = next((i for i, key in enumerate(keys) if _ordinal(key, wanted) is None), 0)
        problems.add(
            parsed.line_of_date[wrong],
            f"a date cannot be {_order_text(wanted)}",
            _date_text(keys[wrong]),
            " or ".join(f"--dates {order}" for order in possible),
            "give another --dates, or none",
        )
        return "", ""
    # with points between, the day comes first wherever the year does not
    if "dmy" in possible and all(key[1] == "." for key in keys):
        return "dmy", "as there are points between"
    if len(possible) == 1:
        certain = all(max(len(key[0]), len(key[3])) == 4 for key in keys) and possible == ["ymd"]
        return possible[0], "the year first" if certain else "no other order gives dates"
    if possible and len(keys) == 1:
        return possible[0], _ONE_DATE
    if not possible:
        wrong = next(
            (i for i, key in enumerate(keys) if all(_ordinal(key, order) is None for order in DATE_ORDERS)),
            len(keys) - 1,
        )
        problems.add(
            parsed.line_of_date[wrong],
            "is no date, or one in another order than the dates above",
            _date_text(keys[wrong]),
            "dates in one order",
            "mend or delete the line",
        )
        return "", ""
    problems.ask(
        "the order of day, month and year cannot be told: the dates can be read in several",
        ", ".join(_date_text(key) for key in keys[:3]),
        [f"--dates {order} ({_reading(keys[0], order)})" for order in possible],
        parsed.line_of_date[0],
    )
    return "", ""


def _reading(key: DateKey, order: str) -> str:
    return str(date.fromordinal(_ordinal(key, order) or 1))


def _date_text(key: DateKey) -> str:
    return f"{key[0]}{key[1]}{key[2]}{key[1]}{key[3]}"


def _order_text(order: str) -> str:
    return "-".join({"d": "day", "m": "month", "y": "year"}[letter] for letter in order)


def _past_midnight(time_s: FloatArray) -> tuple[FloatArray, int]:
    """Times of day that go on after midnight, and how often they pass it: where they fall by half a day or more."""
    filled = ~np.isnan(time_s)
    falls = np.concatenate([[0.0], np.diff(time_s[filled])]) < -DAY_S / 2.0 if filled.any() else np.zeros(0, bool)
    time_s = time_s.copy()
    time_s[filled] += np.cumsum(falls) * DAY_S
    return time_s, int(falls.sum())
