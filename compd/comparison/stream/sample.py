"""The sample of a long recording: a fixed number of rows, spread evenly, whole visits kept."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.alignment.align_recording import align_observations, recorded_observations, session_starts
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.alignment.target_place import held_numbers
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.stream.recording_stream import Block, RecordingStream
from compd.comparison.thinning import SEED
from compd.errors import RecordingError
from compd.machine_builder import build_model
from compd.model import MachineModel
from compd.model.effects import Observations
from compd.recording import Recording


@dataclass(frozen=True)
class Sample:
    """What the first pass through a long recording finds.

    aligned : the rows that were drawn, with their machine.
    rows : of the whole recording, with a time.  rows_of_session : number of a session -> its rows, in their order.
    left_out : reason -> rows of the file that are no row of the recording.
    starts_s : (S,) when its sessions start.  begin_s, end_s : time of the first and of the last row.
    """

    aligned: AlignedRecording
    rows: int
    rows_of_session: dict[int, int]
    left_out: dict[str, int]
    starts_s: FloatArray
    begin_s: float
    end_s: float


def draw_sample(
    stream: RecordingStream,
    most_rows: int | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    progress: Callable[[int], None] = lambda rows: None,
    hold: Sequence[str] = (),
) -> Sample:
    """Draw the sample: of every so many rows one, and of its visit as many rows as noise is estimated from.

    most_rows : how many rows it has, about; None for `sample_rows` of the criteria.
    progress : called with the number of rows that are done, after each block.
    hold : parts of the registration that are not fitted along, as of `open_recording`.
    Raises CompdError for a name of none of them, RecordingError with the problems of the recording.
    """
    held = held_numbers(hold)
    most_rows = criteria.sample_rows if most_rows is None else most_rows
    model = None
    if stream.configuration is not None:
        model = build_model(stream.configuration.geometry, stream.configuration.wiring)
    drawn: IntArray | None = None
    recordings: list[Recording] = []
    observations: list[Observations] = []
    starts_s: list[float] = []
    left_out: Counter[str] = Counter()
    sessions: Counter[int] = Counter()
    count, begin_s, end_s = 0, 0.0, 0.0
    for block in stream.blocks():
        part = block.recording.select(block.own)
        if drawn is None:
            drawn = _drawn_rows(stream.rows, most_rows, _drawn_with_one(part, criteria.max_rows_of_visit))
            begin_s = float(part.time_s[0])
        here = drawn[(drawn >= count) & (drawn < count + part.rows)] - count
        if stream.rows > most_rows:
            here = _with_visits(here, part, criteria.max_rows_of_visit)
        if len(here):
            recordings.append(part.select(here))
            observations.append(_observe(block, here, model, criteria))
        left_out.update(part.left_out)
        sessions.update(_rows_of_session(part))
        started = session_starts(block.recording)[block.own]
        starts_s += part.time_s[started].tolist()
        count += part.rows
        end_s = float(part.time_s[-1])
        progress(count)
    if not recordings:
        raise RecordingError.of(str(stream.path), "has no rows", next_step="record some")
    recording = replace(recordings[0].extended_by(*recordings[1:]), left_out=dict(left_out))
    rows = observations[0].extended_by(*observations[1:])
    rows = replace(rows, session_start=session_starts(recording))
    geometry_hash = "" if stream.configuration is None else stream.configuration.geometry_hash
    aligned = align_observations(recording, model, rows, geometry_hash, criteria, held=held)
    return Sample(aligned, count, dict(sessions), dict(left_out), np.array(starts_s), begin_s, end_s)


def _drawn_with_one(part: Recording, max_rows_of_visit: int) -> float:
    """How many rows come with one that is drawn, by the visits of the first block."""
    if part.visit is None:
        return 1.0
    _, counts = np.unique(part.visit[part.visit >= 0], return_counts=True)
    # long visits are drawn more often
    return float((counts * counts.clip(max=max_rows_of_visit)).sum() / counts.sum()) if len(counts) else 1.0


def _drawn_rows(count: int, most_rows: int, drawn_with_one: float) -> IntArray:
    """(R,) rows of the file, rising: one of every stretch of equal length; all where there are no more."""
    if count <= most_rows:
        return np.arange(count)
    stretches = max(1, int(most_rows / drawn_with_one))
    within = np.random.default_rng(SEED).random(stretches)
    return np.asarray((np.arange(stretches) + within) * count / stretches, dtype=np.int64)


def _with_visits(rows: IntArray, part: Recording, max_rows_of_visit: int) -> IntArray:
    """The rows, and with each those of its visit in this part, of many some that are spread evenly."""
    if part.visit is None:
        return rows
    chosen = [rows]
    for visit in np.unique(part.visit[rows]):
        if visit >= 0:
            of_visit = np.flatnonzero(part.visit == visit)
            spread = np.linspace(0, len(of_visit) - 1, min(len(of_visit), max_rows_of_visit)).astype(np.int64)
            chosen.append(of_visit[spread])
    return np.unique(np.concatenate(chosen))


def _observe(block: Block, rows: IntArray, model: MachineModel | None, criteria: ComparisonCriteria) -> Observations:
    """The block's own rows of this index, observed between their neighbours."""
    own = rows + block.own.start
    around = np.unique(np.concatenate([own - 1, own, own + 1]).clip(0, block.recording.rows - 1))
    observed = recorded_observations(block.recording.select(around), model, criteria)
    return observed.select(np.searchsorted(around, own))


def _rows_of_session(part: Recording) -> dict[int, int]:
    """Number of a session -> its rows; all rows are one session where none was recorded."""
    if part.session is None:
        return {0: part.rows}
    numbers, counts = np.unique(part.session, return_counts=True)
    return dict(zip(numbers.tolist(), counts.tolist(), strict=True))
