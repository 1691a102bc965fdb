"""A recording in memory as a stream of blocks."""

from __future__ import annotations

from compd.comparison import RecordingStream
from compd.configuration import Configuration
from compd.recording import Recording


def in_blocks(recording: Recording, configuration: Configuration | None, rows: int) -> RecordingStream:
    """The recording in blocks of so many rows."""
    begins = range(0, recording.rows, rows)
    return RecordingStream(
        recording.path,
        configuration,
        recording.rows,
        lambda: (recording.select(slice(begin, begin + rows)) for begin in begins),
    )
