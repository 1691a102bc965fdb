"""A recording block by block, for recordings that are larger than the memory.

Example::

    for block in recording_blocks(Path("week.parquet")):
        print(block.rows, block.time_s[0])
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain, pairwise
from pathlib import Path

from compd.configuration import Configuration
from compd.recording.recording import Recording
from compd.recording.recording_builder import RecordingBuilder
from compd.table_file import table_blocks, table_path
from compd.tables import TableBlock

BLOCK_ROWS = 100_000


def recording_blocks(
    path: Path, configuration: Configuration | None = None, rows: int = BLOCK_ROWS
) -> Iterator[Recording]:
    """Read and check a recording block by block, in constant memory and in the order of the file.

    Parameters
    ----------
    path : the recording, NAME.csv or NAME.parquet, with NAME.yaml beside it.
    configuration : the machine that it must fit, as in `read_recording`.
    rows : of the file in a block, at most; a block of empty rows alone is left out.

    Each block is a Recording: its rows have their numbers in the file, the same text has the same number in every
    block, directions of travel go on from block to block, and `sha256` is that of the whole files.

    Raises
    ------
    RecordingError
        As `read_recording` does, as soon as a block has a problem; and where `time_s` does not rise from row to row.
        What only the whole recording shows is reported with the last block.
    """
    path = table_path(path)
    builder = RecordingBuilder(path, configuration, needs_reference=True, in_blocks=True)
    blocks: Iterator[TableBlock | None] = chain(table_blocks(path, builder.id_columns, rows), [None])
    for block, following in pairwise(blocks):
        assert block is not None
        recording = builder.build(block.table, block.problems, last=following is None)
        if recording.rows:
            yield recording
