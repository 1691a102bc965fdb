"""Examination of many recordings on a cluster: a result or a problem for each."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from compd.errors import CompdError
from compd.files import file_stamp
from compd.fleet.cluster import open_cluster
from compd.fleet.engine import Outcome, outcomes
from compd.fleet.fleet_recording import FleetRecording
from compd.fleet.machine_examination import Examination
from compd.fleet.recording_result import NOT_DONE, Command, RecordingResult

# Recordings in one task: comparing 600 rows takes 0.1 s, diagnosing them takes seconds.
BATCH: Mapping[Command, int] = {"compare": 8, "diagnose": 1}


@dataclass(frozen=True)
class FleetRun:
    """Outcome of the examination of a fleet's recordings."""

    results: tuple[RecordingResult, ...]  #: one for each recording, in the order in which they were given
    kept: int = 0  #: how many of them are those of an earlier run
    #: whether Ctrl-C ended the work; recordings that were not done have a problem that says so
    interrupted: bool = False


def examine_fleet(
    examination: Examination,
    recordings: Sequence[FleetRecording],
    scheduler: str | None = None,
    progress: Callable[[RecordingResult], None] = lambda result: None,
    earlier: Iterable[RecordingResult] = (),
) -> FleetRun:
    """Examine every recording; a faulty one does not stop the others.

    Parameters
    ----------
    examination : Examination
        What is done with each.
    recordings : sequence of FleetRecording
        As `find_recordings` has them.
    scheduler : str, optional
        Address of a Dask scheduler; left out, all cores of this computer do the work.
    progress : callable
        Called with each result as it comes, first with those that are kept.
    earlier : iterable of RecordingResult
        Results of an earlier run. One whose `basis` is that of a recording is kept; all others are of no use.

    Returns
    -------
    FleetRun

    Raises
    ------
    CompdError
        Where the cluster cannot be used: `open_cluster`.
    """
    basis = {recording: examination.basis(recording) for recording in recordings}
    known = {result.basis: result for result in earlier if result.basis and not result.problem}
    results = {recording: known[basis[recording]] for recording in recordings if basis[recording] in known}
    kept = len(results)
    # long ones first, so that no worker idles at the end
    todo = sorted((recording for recording in recordings if recording not in results), key=_size, reverse=True)
    for result in results.values():
        progress(result)
    interrupted = False
    try:
        if todo:
            # the other recordings lie where the first one does
            with open_cluster(scheduler, [todo[0].path, *examination.files]) as client:
                for outcome in outcomes(client, examination, todo, BATCH[examination.command]):
                    result = _result(outcome, examination, basis[outcome.item])
                    results[outcome.item] = result
                    progress(result)
    except KeyboardInterrupt:
        interrupted = True
        for recording in todo:
            if recording not in results:
                not_done = CompdError.of(str(recording), NOT_DONE)
                results[recording] = _result(Outcome(recording, None, not_done), examination, "")
    return FleetRun(tuple(results[recording] for recording in recordings), kept, interrupted)


def _size(recording: FleetRecording) -> int:
    """Bytes of a recording; 0 if inaccessible."""
    stamp = file_stamp(recording.path)
    return 0 if stamp is None else stamp[1]


def _result(outcome: Outcome[FleetRecording, RecordingResult], examination: Examination, basis: str) -> RecordingResult:
    """The result of a recording with the hash of its inputs; or its problem."""
    if outcome.result is not None:
        return replace(outcome.result, basis=basis)
    error, recording = outcome.error, outcome.item
    problem = str(error) if isinstance(error, CompdError) else f"unexpected: {type(error).__name__}: {error}"
    return RecordingResult(
        recording=str(recording),
        machine=recording.machine,
        command=examination.command,
        model=examination.model_path(recording),
        started_at=recording.started_at,
        problem=problem,
    )
