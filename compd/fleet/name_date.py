"""Dates in names of files and directories."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import UTC, datetime

# ISO 8601 as it stands in names of files and directories: 2026-01, 2026-01-05, 20260105, 2026-01-05T0830.
_DATE = re.compile(
    r"(?<!\d)(?P<year>(?:19|20)\d\d)(?:-(?P<month>\d\d)(?:-(?P<day>\d\d))?|(?P<month2>\d\d)(?P<day2>\d\d))"
    r"(?:[T_](?P<hour>[01]\d|2[0-3])[:\-h]?(?P<minute>[0-5]\d)(?:[:\-]?[0-5]\d)?)?(?!\d)"
)
_YEAR = re.compile(r"(?:19|20)\d\d")


def date_in(names: Iterable[str]) -> datetime | None:
    """The date in the first name that has one, at midnight without a time; read as UTC."""
    for name in names:
        if match := _DATE.search(name):
            month, day = match["month"] or match["month2"], match["day"] or match["day2"] or "1"
            time = (int(match["hour"] or 0), int(match["minute"] or 0))
            try:
                return datetime(int(match["year"]), int(month), int(day), *time, tzinfo=UTC)
            except ValueError:
                continue
    return None


def is_date(name: str) -> bool:
    """Whether a directory's name is only a date: "2026", "2026-01", "2026-01-05"."""
    return bool(_DATE.fullmatch(name) or _YEAR.fullmatch(name))
