"""Writing a recording's table as Parquet: the columns of the CSV file, with their units in the schema."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from numpy.typing import ArrayLike

from compd.columns import parse_name
from compd.recording.sidecar import FORMAT
from compd.tables import arrow_modules
from compd.units import unit_of

# Rows of a row group: few enough for readers in blocks, enough for good compression.
ROW_GROUP_ROWS = 100_000
# name -> (N,) numbers, nan or None where nothing was measured, or texts, None where there is none.
Block = Mapping[str, ArrayLike | Sequence[float | str | None]]


def arrow_schema(path: Path, names: Iterable[str], text_columns: Iterable[str] = ()) -> Any:
    """The schema of a recording's table: float64, or text in `text_columns`, each field with its `unit`.

    path : the file that needs it. Raises RecordingError if pyarrow is not installed.
    """
    arrow, _ = arrow_modules(path)
    text = set(text_columns)
    fields = [
        arrow.field(name, arrow.string() if name in text else arrow.float64(), metadata={"unit": _unit(name)})
        for name in names
    ]
    return arrow.schema(fields, metadata={"compd.format": str(FORMAT)})


def arrow_batch(path: Path, schema: Any, block: Block) -> Any:
    """A block as a record batch of the schema; nan becomes null."""
    arrow, _ = arrow_modules(path)
    arrays = [arrow.array(block[field.name], field.type, from_pandas=True) for field in schema]
    return arrow.record_batch(arrays, schema=schema)


def write_parquet(file: BinaryIO, path: Path, schema: Any, batches: Iterable[Any]) -> None:
    """Write record batches of the schema to `file` as Parquet, in row groups of ROW_GROUP_ROWS rows.

    path : as messages name it. Raises OSError if the disk does not take it.
    """
    arrow, parquet = arrow_modules(path)
    with parquet.ParquetWriter(file, schema, compression="zstd", write_page_checksum=True) as writer:
        for table in _row_groups(arrow, schema, batches):
            writer.write_table(table, ROW_GROUP_ROWS)


def _row_groups(arrow: Any, schema: Any, batches: Iterable[Any]) -> Iterator[Any]:
    """Tables of ROW_GROUP_ROWS rows each, the last of what is left."""
    waiting: list[Any] = []
    rows = 0
    for batch in batches:
        waiting.append(batch)
        rows += batch.num_rows
        if rows >= ROW_GROUP_ROWS:
            table = arrow.Table.from_batches(waiting, schema)
            whole = rows - rows % ROW_GROUP_ROWS
            yield table.slice(0, whole)
            waiting = table.slice(whole).to_batches()
            rows -= whole
    yield arrow.Table.from_batches(waiting, schema)


def _unit(name: str) -> str:
    column = parse_name(name)
    return column.unit if column else unit_of(name)
