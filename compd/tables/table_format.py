"""The formats in which a recording's table is written."""

from __future__ import annotations

from enum import StrEnum


class TableFormat(StrEnum):
    """CSV for every spreadsheet; Parquet for millions of rows."""

    CSV = "csv"
    PARQUET = "parquet"
