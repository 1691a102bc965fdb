"""Stamps of date and time, their order of day and month, and times coarser than the rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.unit.instruments.reading import read, refused

AT_S = 16 * 3600 + 56 * 60 + 8.25


def stamped(*stamps: str, delimiter: str = ";") -> str:
    """Rows with these stamps, and positions."""
    rows = [delimiter.join([stamp, str(i), "2", "3"]) for i, stamp in enumerate(stamps)]
    return "\n".join([delimiter.join(["Time", "X [mm]", "Y [mm]", "Z [mm]"]), *rows]) + "\n"


@pytest.mark.parametrize(
    ("first", "second", "assumed"),
    [
        ("2025-02-12T16:56:08.25", "2025-02-13T16:56:08.50", "year-month-day"),
        ("2025-02-12 16:56:08,25", "2025-02-13 16:56:08,50", "year-month-day"),
        ("2025-02-12T16:56:08.250Z", "2025-02-13T16:56:08.500Z", "in UTC"),
        ("2025-02-12T17:56:08.25+01:00", "2025-02-13T15:56:08.50-0100", "in UTC"),
        ("12.02.2025 16:56:08.25", "13.02.2025 16:56:08.5", "day-month-year"),
        ("12.2.25 16:56:08,25", "13.2.25 16:56:08,5", "day-month-year"),
        ("11.02.2025 16:56:08,25", "12.02.2025 16:56:08,5", "day-month-year, as there are points between"),
        ("02/12/2025 04:56:08.25 PM", "02/13/2025 04:56:08.5 PM", "month-day-year, no other order"),
        ("02/28/25 16:56:08.25", "03/01/25 16:56:08.5", "month-day-year"),
        ("31/12/2025 16:56:08.25", "01/01/2026 16:56:08.5", "day-month-year"),
    ],
)
def test_two_days_in_every_dress(tmp_path: Path, first: str, second: str, assumed: str) -> None:
    export = read(tmp_path, stamped(first, second))
    assert export.time_s is not None
    np.testing.assert_allclose(export.time_s, [AT_S, AT_S + 86400.25], atol=1e-6)
    assert export.time_std_s == 0.0
    assert assumed in export.taken["time"]


def test_the_order_of_day_and_month_is_asked_where_it_matters(tmp_path: Path) -> None:
    both = stamped("02/03/2025 16:56:08.25", "03/03/2025 16:56:08.25")
    question = refused(tmp_path, both)
    assert "--dates dmy (2025-03-02) or --dates mdy (2025-02-03)" in question
    for order, days in (("dmy", 1), ("mdy", 28)):
        export = read(tmp_path, both, dates=order)
        assert export.time_s is not None
        assert np.ptp(export.time_s) == days * 86400
    one = read(tmp_path, stamped("02/03/25 16:56:08.25", "02/03/25 16:56:08.75"))
    assert one.time_s is not None
    np.testing.assert_allclose(one.time_s, [AT_S, AT_S + 0.5])
    assert "all rows of one date" in one.taken["time"]
    assert "a date cannot be year-month-day" in refused(tmp_path, both, dates="ymd")


@pytest.mark.parametrize(
    ("stamps", "wanted"),
    [
        (("2025-02-12 16:56:08", "2025-02-12 16:5"), "export.txt:3: column 1 'Time' is no time"),
        (("2025-02-12 16:56:08", "2025-02-12 16:61:08"), "export.txt:3: column 1 'Time' is no time"),
        (("2025-02-12 16:56:08", "2025-02-30 16:56:08"), "export.txt:3: is no date, or one in another order"),
        (("2025-02-12 16:56:08", "12.02.2025 16:56:09"), "export.txt:3: is no date, or one in another order"),
        (("02/12/2025 13:56:08 PM", "02/12/2025 01:56:09 PM"), "export.txt:2: column 1 'Time' is no time"),
        (("2025-02-12 16:56:08", "16:56:09"), "export.txt:3: column 1 'Time' has no date"),
        (("2025-02-12 16:56:08Z", "2025-02-12 16:56:09"), "export.txt:3: column 1 'Time' has no zone"),
    ],
)
def test_stamps_that_are_none_are_refused_with_their_line(tmp_path: Path, stamps: tuple[str, ...], wanted: str) -> None:
    assert wanted in refused(tmp_path, stamped(*stamps))


def test_date_and_time_in_columns_of_their_own(tmp_path: Path) -> None:
    export = read(tmp_path, "Datum;Uhrzeit;X mm\n12.02.2025;16:56:08,25;1\n13.02.2025;16:56:08,50;2\n")
    assert export.time_s is not None
    np.testing.assert_allclose(export.time_s, [AT_S, AT_S + 86400.25])
    american = "02/12/2025 04:56:08.25 PM 1.0 2.0 3.0\n02/13/2025 04:56:08.50 PM 1.0 2.0 4.0\n"
    export = read(tmp_path, american, unit="mm")
    assert export.time_s is not None
    np.testing.assert_allclose(export.time_s, [AT_S, AT_S + 86400.25])
    assert export.axes == ("x", "y", "z")


def test_the_time_of_day_goes_on_past_midnight(tmp_path: Path) -> None:
    export = read(tmp_path, stamped("23:59:59.5", "00:00:00.5", "00:00:01.0"))
    assert export.time_s is not None
    np.testing.assert_allclose(np.diff(export.time_s), [1.0, 0.5])
    assert "past midnight 1 time" in export.taken["time"]


def test_whole_seconds_are_spread_and_their_uncertainty_is_told(tmp_path: Path) -> None:
    export = read(tmp_path, stamped("16:56:08", "16:56:08", "16:56:09", "16:56:09", "16:56:09", "16:56:09"))
    assert export.time_s is not None
    np.testing.assert_allclose(export.time_s - (AT_S - 0.25), [0.625, 0.875, 1.125, 1.375, 1.625, 1.875])
    assert export.time_std_s == pytest.approx(1 / np.sqrt(12))
    assert "up to 4 rows in each, spread within: +- 0.29 s" in export.taken["time"]
    seldom = read(tmp_path, stamped("16:56:08", "16:56:18"))
    assert seldom.time_std_s == pytest.approx(1 / np.sqrt(12))


def test_numbers_of_seconds_and_their_unit(tmp_path: Path) -> None:
    def times(text: str, **said: object) -> list[float]:
        export = read(tmp_path, text, **said)
        assert export.time_s is not None
        return export.time_s.tolist()

    assert times("time [ms],x_mm\n1000,1\n1500,2\n") == [1.0, 1.5]
    assert times("time,x_mm\n1.0,1\n1.5,2\n") == [1.0, 1.5]
    assert times("time,x_mm\n1000,1\n1500,2\n", columns=("time[ms]", "x")) == [1.0, 1.5]
    question = refused(tmp_path, "time,x_mm\n1000,1\n1500,2\n")
    assert "no unit of time" in question
    assert "time[ms]" in question
    coarse = read(tmp_path, "time_s,x_mm\n1.0,1\n1.0,2\n1.1,3\n")
    assert coarse.time_s is not None
    np.testing.assert_allclose(coarse.time_s, [1.025, 1.075, 1.125])
    assert coarse.time_std_s == pytest.approx(0.1 / np.sqrt(12))


def test_a_rate_gives_times_to_rows_without_any(tmp_path: Path) -> None:
    export = read(tmp_path, "1.0 2.0 3.0\n1.5 2.5 3.5\n", unit="inch", rate_hz=1000.0)
    assert export.time_s is not None
    np.testing.assert_allclose(export.time_s, [0.0, 0.001])
    np.testing.assert_allclose(export.values[0], [25.4, 50.8, 76.2])
    assert "has a time" in refused(tmp_path, "time_s,x_mm\n1,2\n", rate_hz=10.0)
    assert "is no rate" in refused(tmp_path, "x_mm,y_mm\n1,2\n", rate_hz=-1.0)


def counted(times: Sequence[str]) -> str:
    return "Time;X [mm]\n" + "".join(f"{time};{k}\n" for k, time in enumerate(times))


@pytest.mark.parametrize(
    ("start", "step", "decimals"),
    [
        (45592.124722, 0.05 / 86400, 9),  # a spreadsheet's days, twenty rows a second
        (45592.12472, 5.0 / 86400, 5),  # a row every 5 s
        (45592.12472, 60.0 / 86400, 6),  # and every minute
        (12.345678, 0.05 / 3600, 8),  # hours
    ],
)
def test_times_that_are_no_seconds_are_asked_about(tmp_path: Path, start: float, step: float, decimals: int) -> None:
    text = counted([f"{start + step * k:.{decimals}f}" for k in range(20)])
    message = refused(tmp_path, text)
    assert "no unit of time in its name" in message
    assert "time[day]" in message
    export = read(tmp_path, text, columns=("time[day]", "x[mm]"))
    assert export.time_s is not None
    assert np.ptp(export.time_s) == pytest.approx(19 * step * 86400, rel=0.05)


@pytest.mark.parametrize(
    ("start", "step", "decimals"),
    [(0.0, 0.05, 3), (45592.125, 0.05, 3), (1730000000.0, 0.001, 3), (0.5, 0.0005, 4), (30000.00001, 60.0, 5)],
)
def test_times_that_may_be_seconds_are_seconds(tmp_path: Path, start: float, step: float, decimals: int) -> None:
    export = read(tmp_path, counted([f"{start + step * k:.{decimals}f}" for k in range(20)]))
    assert export.time_s is not None
    assert np.ptp(export.time_s) == pytest.approx(19 * step, rel=1e-3)


def test_times_all_alike_are_no_error_here(tmp_path: Path) -> None:
    assert "no unit of time" in refused(tmp_path, counted(["45592.124722"] * 3))
