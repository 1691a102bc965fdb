"""The file of a recording's table, CSV or Parquet by its suffix: read whole, or block by block."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from compd.columns import ID_COLUMNS, is_header
from compd.errors import RecordingError
from compd.files import folder_problem
from compd.tables import ParquetTable, ProblemList, Table, TableBlock, csv_blocks, csv_row_count, read_table

CSV, PARQUET = ".csv", ".parquet"
SUFFIXES = (CSV, PARQUET)


def table_path(path: Path) -> Path:
    """The table's file of a recording, given by itself or by its sidecar NAME.yaml.

    Raises RecordingError for a folder, and if two tables have this sidecar: a copy may have been changed since.
    """
    _refuse_folder(path)
    if path.suffix not in (".yaml", ".yml"):
        return path
    tables = [table for suffix in SUFFIXES if (table := path.with_suffix(suffix)).exists()]
    if len(tables) > 1:
        names = ", ".join(table.name for table in tables)
        raise RecordingError.of(str(path), "is beside two tables", value=names, next_step=f"give one of them: {names}")
    return tables[0] if tables else path.with_suffix(CSV)


def _refuse_folder(path: Path) -> None:
    if problem := folder_problem(path, allowed="NAME.csv or NAME.parquet"):
        raise RecordingError(problem)


def written_path(path: Path) -> Path:
    """The path for writing a recording: NAME.csv if `path` has no suffix of a table. RecordingError for a folder."""
    _refuse_folder(path)
    return path if path.suffix in SUFFIXES else path.with_name(f"{path.name}{CSV}")


def read_table_file(path: Path, problems: ProblemList, id_columns: Collection[str]) -> Table | None:
    """All rows; faults go to `problems`. None without any table.

    id_columns : columns that may hold text.
    """
    if path.suffix != PARQUET:
        return read_table(path, problems, is_header, id_columns)
    try:
        return ParquetTable(path, id_columns).whole(problems)
    except RecordingError as error:
        problems.problems += error.problems
        return None


def table_blocks(path: Path, id_columns: Collection[str], rows: int) -> Iterator[TableBlock]:
    """The rows in blocks up to a size, in the order of the file and in constant memory; at least one block.

    Raises RecordingError for a file that cannot be read.
    """
    if path.suffix == PARQUET:
        return ParquetTable(path, id_columns).blocks(rows)
    return csv_blocks(path, is_header, id_columns, rows)


def row_count(path: Path) -> int:
    """Number of rows of the table, including empty ones: from Parquet's metadata, or lines under the CSV header.

    Raises RecordingError for a file that cannot be read.
    """
    path = table_path(path)
    return ParquetTable(path, ID_COLUMNS).row_count if path.suffix == PARQUET else csv_row_count(path)
