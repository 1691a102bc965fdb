"""Comparison of a recording with the model, and diagnosis of the missing effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from compd.api.arguments import Effects, Model, Recorded, opened_model, opened_recording
from compd.comparison import Comparison, ComparisonCriteria, counted_by_neighbours
from compd.comparison import compare as compare_aligned
from compd.diagnosis import Criteria, Diagnosis
from compd.diagnosis import diagnose as diagnose_aligned
from compd.model.effects import can_concern
from compd.model.library import beside_library, gather_effects
from compd.parameter_ranges import check_ranges


def compare(recording: Recorded, model: Model = None, *, criteria: ComparisonCriteria | None = None) -> Comparison:
    """Compare a recording with the model of its machine; nothing is fitted.

    Parameters
    ----------
    recording : AlignedRecording, str or Path
        What was measured, as `open_recording` returns it; or the path of a recording whose machine comes with compd.
    model : ModelFile, str or Path, optional
        The effects that the model has; left out, none: what is left then is everything that the gauges do not see.
    criteria : ComparisonCriteria, optional
        The numbers on which the result rests; left out, those by which the recording was opened. A recording that is
        open already keeps its frame and its speeds: `open_recording` takes criteria, too.

    Returns
    -------
    Comparison
        Residuals in um, the noise floor, what each part contributes, and what the residual follows.

    Raises
    ------
    RecordingError
        Where fewer than five rows have everything that is needed.
    StateError
        Where the model belongs to another machine.
    CompdError
        Where an effect of the model needs a quantity that the recording does not have.

    Examples
    --------
    >>> import compd
    >>> comparison = compd.compare("monday.csv")
    >>> round(comparison.rms_um, 2)  # error, um per coordinate
    0.82
    >>> round(comparison.floor.um, 2)  # what noise alone would be
    0.16
    """
    aligned = opened_recording(recording, criteria)
    file = opened_model(model, aligned)
    comparison = compare_aligned(aligned, file.fitted, file.covariance)
    # in units of what neighbouring rows show where they contradict the declared noise
    left_um = None if comparison.at_floor else comparison.residual_um
    counted = counted_by_neighbours(comparison, left_um)
    return comparison if counted is None else replace(comparison, floor=counted.floor)


def diagnose(
    recording: Recorded,
    model: Model = None,
    *,
    effects: Effects = (),
    criteria: Criteria = Criteria(),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Learn which physical effect the model of the machine lacks.

    Every effect of the library, every pair and the best triples are fitted to one part of the recording and tried on
    rows that were left out; so is every measured quantity, for causes that the library does not have.

    Parameters
    ----------
    recording : AlignedRecording, str or Path
        What to learn from, as for `compare`. Sessions on several days, different loads, temperatures and directions
        make effects distinguishable.
    model : ModelFile, str or Path, optional
        What is known already; its effects are fitted along. The file is not changed.
    effects : str, Path, Effect, or a sequence of these
        Effects of your own, tried beside those that are installed: each an effect, or a source of several as
        `load_effects` takes it.
    criteria : Criteria
        The numbers on which the verdict rests; every one has its default. Those of the comparison beneath are the
        recording's: `open_recording` takes them.
    progress : callable
        Called with a text when a stage of the search begins. A diagnosis takes seconds.

    Returns
    -------
    Diagnosis
        The verdict with its evidence.

    Raises
    ------
    CompdError
        As `compare`, and as `load_effects` for `effects`.

    Notes
    -----
    With ``machine: external`` only those effects of the library are tried that act on what was predicted; the others
    act inside a machine that compd does not know.

    The selection is by cross-validation over sessions with a penalty for each further effect (M. Stone, J. R. Stat.
    Soc. B 36 (1974) 111); every number that decides stands with its reason in `compd.diagnosis.criteria`.

    Examples
    --------
    >>> import compd
    >>> diagnosis = compd.diagnose("monday.csv")
    >>> diagnosis.verdict, [step.effect.id for step in diagnosis.steps]
    ('identified', ['link_expansion'])
    """
    aligned = opened_recording(recording)
    file = opened_model(model, aligned)
    given = gather_effects(effects)
    rows, every = aligned.rows, beside_library(given)
    check_ranges(aligned.ranges, every)
    candidates = [
        aligned.on_machine(effect)
        for effect in every
        if effect.id in given or can_concern(effect, rows.available, rows.links)
    ]
    progress = progress or (lambda status: None)
    return diagnose_aligned(aligned, file.fitted, file.covariance, candidates, progress, criteria)
