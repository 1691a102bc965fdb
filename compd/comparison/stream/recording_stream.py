"""A recording as a stream of blocks, each with the rows before and after it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple

from compd.comparison.alignment.align_recording import align_observations, recorded_observations
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.open import recorded_machine
from compd.configuration import Configuration, Machine
from compd.errors import Problem, RecordingError
from compd.recording import Recording, recording_blocks
from compd.table_file import row_count

# In memory a comparison takes 9 kB a row: more rows than these would take more than 2 GB.
LONG_ROWS = 200_000
# A block and what is computed from it take about 3 kB a row; in larger blocks a row costs no less.
BLOCK_ROWS = 32_768


class Block(NamedTuple):
    """Rows of a recording that follow one another.

    recording : the rows of the block, with the last row before it and the first one after it where there are such:
        a row's speed is known from its neighbours.
    own : which of these rows are the block's.
    """

    recording: Recording
    own: slice


@dataclass(frozen=True)
class RecordingStream:
    """A recording that is read anew for each pass.

    path : of the recording.  configuration : of its machine, None for an external model.
    rows : of the file; a few of them may be empty or without time.
    read : gives the blocks, from the first one on.
    """

    path: Path
    configuration: Configuration | None
    rows: int
    read: Callable[[], Iterator[Recording]]

    @classmethod
    def of_file(cls, path: Path, configuration: Configuration | None) -> RecordingStream:
        """Raises RecordingError for a file that cannot be read; `blocks` does for one with problems."""
        return cls(path, configuration, row_count(path), lambda: recording_blocks(path, configuration, BLOCK_ROWS))

    def blocks(self) -> Iterator[Block]:
        """The blocks in their order."""
        before: Recording | None = None
        parts: Iterator[Recording | None] = chain(self.read(), [None])
        for part, after in pairwise(parts):
            assert part is not None
            first = [] if before is None else [before.select(slice(-1, None))]
            last = [] if after is None else [after.select(slice(0, 1))]
            parts_around = [*first, part, *last]
            whole = parts_around[0].extended_by(*parts_around[1:])
            yield Block(
                replace(whole, left_out=part.left_out, warnings=part.warnings),
                slice(len(first), len(first) + part.rows),
            )
            before = part


def is_long(path: Path) -> bool:
    """Whether a recording has more rows than LONG_ROWS, so that it is compared block by block.

    False for a file that cannot be read: who reads it whole says everything that is wrong.
    """
    try:
        return row_count(path) > LONG_ROWS
    except RecordingError:
        return False


def open_stream(path: Path, machine: Machine | None = None) -> RecordingStream:
    """A recording of any length with its machine, arguments as of `open_recording`.

    Raises RecordingError for a file that cannot be read, or a machine that does not come with compd.
    """
    problems: list[Problem] = []
    configuration = recorded_machine(path, machine, problems)
    if problems:
        raise RecordingError(problems)
    return RecordingStream.of_file(path, configuration)


def align_block(block: Block, sample: AlignedRecording) -> AlignedRecording:
    """The block's own rows on the machine of the sample, and in its frame."""
    rows = recorded_observations(block.recording, sample.model, sample.criteria).select(block.own)
    recording = block.recording.select(block.own)
    return align_observations(recording, sample.model, rows, sample.geometry_hash, sample.criteria, part_of=sample)
