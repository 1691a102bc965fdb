"""Examining many recordings on a cluster: one result for each, a problem where one cannot be examined."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from compd.errors import CompdError, Problem
from compd.fleet.cluster import open_cluster
from compd.fleet.engine import Outcome, outcomes
from compd.fleet.examination import Examination, machine_name
from compd.fleet.recording_result import Command, RecordingResult

# Recordings in one task: to compare 600 rows takes 0.1 s, to diagnose them seconds.
BATCH: Mapping[Command, int] = {"compare": 8, "diagnose": 1}


@dataclass(frozen=True)
class FleetRun:
    """What became of the recordings of a fleet.

    Attributes
    ----------
    results : one for each recording, in the order in which they were given.
    interrupted : whether Ctrl-C ended the work; recordings that were not done have a problem that says so.
    """

    results: tuple[RecordingResult, ...]
    interrupted: bool = False


def examine_fleet(
    examination: Examination,
    paths: Sequence[Path],
    scheduler: str | None = None,
    progress: Callable[[RecordingResult], None] = lambda result: None,
) -> FleetRun:
    """Examine every recording; what is wrong with one stops none of the others.

    Parameters
    ----------
    examination : Examination
        What is done with each.
    paths : sequence of Path
        The recordings, as `find_recordings` has them.
    scheduler : str, optional
        Address of a Dask scheduler; left out, all cores of this computer do the work.
    progress : callable
        Called with each result as it comes.

    Returns
    -------
    FleetRun

    Raises
    ------
    CompdError
        Where the cluster cannot be used: `open_cluster`.
    """
    results: dict[Path, RecordingResult] = {}
    interrupted = False
    try:
        # the other recordings lie where the first one does
        with open_cluster(scheduler, [*paths[:1], *examination.files]) as client:
            for outcome in outcomes(client, examination, paths, BATCH[examination.command]):
                result = outcome.result if outcome.result is not None else _failed(outcome, examination)
                results[outcome.item] = result
                progress(result)
    except KeyboardInterrupt:
        interrupted = True
        for path in paths:
            if path not in results:
                not_done = CompdError(Problem(where=str(path), what="was not done: Ctrl-C ended the work before"))
                results[path] = _failed(Outcome(path, None, not_done), examination)
    return FleetRun(tuple(results[path] for path in paths), interrupted)


def _failed(outcome: Outcome[Path, RecordingResult], examination: Examination) -> RecordingResult:
    """The result of a recording that could not be examined."""
    error, machine = outcome.error, machine_name(outcome.item)
    problem = str(error) if isinstance(error, CompdError) else f"unexpected: {type(error).__name__}: {error}"
    return RecordingResult(
        recording=str(outcome.item),
        machine=machine,
        command=examination.command,
        model=str(examination.models.get(machine, "")),
        problem=problem,
    )
