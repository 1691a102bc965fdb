"""The job: from a machine's drawing and recordings of poses to the machine as built."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, rms
from compd.calibration.block_sets import block_sets
from compd.calibration.calibration import CalibratedNumber, Calibration, GrossPose, TriedBlock
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.held_out import FEWEST_ROWS, PARTS, Fold, HeldOut, folds, held_out
from compd.calibration.identifiability import held_combinations, length_scale_is_told
from compd.calibration.machine_fit import (
    MachineFit,
    declared_mm,
    fit_machine,
    in_likelier_coordinates,
    registered_mm,
)
from compd.calibration.parameters import WORDS, Parameters, calibration_parameters
from compd.calibration.pose_errors import errors_alone, errors_of_folds
from compd.calibration.poses import MeasuredPoses, links_of_pose
from compd.calibration.prediction_map import prediction_map
from compd.calibration.untested import Untested, untested_blocks
from compd.comparison import AlignedRecording, compare
from compd.errors import CompdError, Problem
from compd.model import MachineModel


class Selection(NamedTuple):
    """needed : blocks by their place.  without, with_it : (B) held-out errors without and with a block, all others as
    when it was judged.  dropped : in the order in which they went."""

    needed: tuple[int, ...]
    without: tuple[HeldOut, ...]
    with_it: tuple[HeldOut, ...]
    dropped: tuple[int, ...]


def select_blocks(
    fit: MachineFit, parts: list[Fold], refused: frozenset[int] = frozenset(), said: Callable[[str], None] | None = None
) -> Selection:
    """Begins with all blocks but those refused; drops the one that held-out poses miss least, until they miss each."""
    block_of, blocks = fit.parameters.block_of, fit.parameters.blocks
    kept = [block for block in range(len(blocks)) if block not in refused]
    none = HeldOut(np.nan, np.nan)
    without, with_it, dropped = [none] * len(blocks), [none] * len(blocks), []

    def free(chosen: list[int]) -> BoolArray:
        return np.isin(block_of, chosen)

    now = held_out(fit, free(kept), parts)
    while kept:
        if said is not None:
            said(f"blocks that held-out poses need, of {len(kept)}")
        tried = {block: held_out(fit, free([b for b in kept if b != block]), parts) for block in kept}
        for block, error in tried.items():
            without[block], with_it[block] = error, now
        least = min(kept, key=lambda block: tried[block].score)
        if tried[least].score - now.score > CalibrationCriteria.least_fall:
            break
        kept.remove(least)
        dropped.append(least)
        now = tried[least]
    drawn = held_out(fit, free([]), parts)
    if kept and drawn.score - now.score <= CalibrationCriteria.least_fall:
        # together they do not do what each does beside the others
        dropped, kept, now = [*dropped, *kept], [], drawn
    for block in refused:
        without[block], with_it[block] = now, held_out(fit, free(sorted([*kept, block])), parts)
    return Selection(tuple(kept), tuple(without), tuple(with_it), tuple(dropped))


def calibrate(
    recordings: Sequence[AlignedRecording],
    sealed: Sequence[AlignedRecording] = (),
    progress: Callable[[str], None] | None = None,
    blocks: Sequence[str] = (),
) -> Calibration:
    """Numbers of a machine's drawing from recordings at rest, each with its own instrument, frame and noise.

    recordings : of one machine, whose drawing and tolerance all have.  sealed : looked at last.
    progress : called with what is done.  blocks : ids of the effects that may be taken; all if empty.
    Raises CompdError where the recordings are of different machines or of none, or hold too few poses.
    """
    said = progress or (lambda _: None)
    model = _one_machine([*recordings, *sealed])
    rows = recordings[0].rows.extended_by(*(one.rows for one in recordings[1:]))
    # a target whose place is fitted along takes what the place of the tip would be
    without = ["tool_offset"] if all(one.target is not None for one in recordings) else []
    without += [name for name in WORDS if blocks and name not in blocks]
    parameters = calibration_parameters(model, rows, recordings[0].ranges, without)
    if not parameters.names or not set(blocks) <= set(WORDS):
        raise CompdError.of(
            "blocks",
            "name no numbers of this machine's drawing",
            value=", ".join(blocks),
            allowed=", ".join(WORDS),
            next_step="choose of these, or leave it out for all",
        )
    said("derivatives")
    poses = [MeasuredPoses.of(one, parameters) for one in recordings]
    _check_rows(poses)
    said("all numbers")
    everything = np.ones(len(parameters.names), dtype=bool)
    poses = in_likelier_coordinates(fit_machine(poses, parameters, everything))
    whole = fit_machine(poses, parameters, everything)
    parts = folds(whole)
    untested = untested_blocks(model, whole)
    every = block_sets(parameters.blocks, parameters.block_of, whole.result.scale, list(untested.blocks))
    sets = every.likely(whole.normal)
    as_drawn = np.flatnonzero(~sets.inside.any(axis=0)).tolist()
    selection = select_blocks(whole, parts, frozenset(as_drawn), said)
    said("the numbers of the machine as built")
    sets = sets if selection.needed else every.none
    free = sets.free
    fit = fit_machine(poses, parameters, free, sets)
    fit = fit.about(every.whole.averaged(fit.normal))
    drawn = fit_machine(poses, parameters, np.zeros_like(free))
    chosen_blocks = np.flatnonzero(sets.inside.any(axis=0)).tolist()
    fitted = parameters.split(fit.theta, fit.covariance, chosen_blocks)
    order = np.concatenate([np.zeros(0, dtype=int), *(np.flatnonzero(parameters.block_of == b) for b in chosen_blocks)])
    said("errors of held-out poses")
    held_out = tuple(
        errors_of_folds(what, fit, drawn, chosen)
        for what, chosen in (("random poses", _once(parts)), ("regions", [one for one in parts if one.regions]))
        if chosen
    )
    said("uncertainty over the workspace")
    prediction = prediction_map(model, fit)
    prior = whole.result.scale[parameters.block_of]
    noise_um, noise_urad = _noise_um(fit)
    registered = any(one.registration is not None for one in recordings)
    left = held_out[0].after_rms_um
    return Calibration(
        machine=recordings[0].recording.machine,
        recordings=tuple(str(one.recording.path) for one in recordings),
        numbers=_numbers(parameters, fit, selection, prior),
        covariance=_in_units(parameters, fit.covariance),
        fitted=fitted,
        fitted_covariance=fit.covariance[np.ix_(order, order)],
        blocks=_blocks(parameters, selection, untested.blocks, as_drawn),
        learned=tuple(
            errors_alone(one.aligned.recording.path.name, one, fitted, out)
            for one, out in zip(poses, fit.outlier, strict=True)
        ),
        held_out=held_out,
        sealed=tuple(
            errors_alone(
                f"sealed {one.recording.path.name}",
                _weighed_alike(MeasuredPoses.of(one, parameters), poses),
                fitted,
                np.zeros(one.recording.rows, dtype=bool),
            )
            for one in sealed
        ),
        held=held_combinations(model, parameters, fit.result.C, prior, free, registered),
        gross=_gross(fit),
        warnings=_warnings(model, parameters, fit, untested, rows.constants.tolerance_mm),
        noise_um=noise_um,
        noise_urad=noise_urad,
        left_over=(left / noise_um) ** 2 if noise_um > 0 else float("nan"),
        sigma_mm=fit.sigma_mm[0],
        in_links=poses[0].to_links is not None,
        prior_scale={block.effect.id: float(whole.result.scale[b]) for b, block in enumerate(parameters.blocks)},
        prediction=prediction,
    )


def _weighed_alike(sealed: MeasuredPoses, learned: Sequence[MeasuredPoses]) -> MeasuredPoses:
    """Registered by errors of links where these are what the recordings learned from have."""
    to_links = links_of_pose(sealed.aligned)
    in_links = any(one.to_links is not None for one in learned)
    return replace(sealed, to_links=to_links) if in_links and to_links is not None else sealed


def _one_machine(recordings: Sequence[AlignedRecording]) -> MachineModel:
    hashes = {one.geometry_hash for one in recordings}
    model = recordings[0].model if recordings else None
    if model is None or len(hashes) != 1:
        raise CompdError.of(
            ", ".join(str(one.recording.path) for one in recordings) or "calibrate",
            "is no calibration of one machine",
            value=f"{len(hashes)} machines" if hashes != {""} else "an external model, which has no drawing",
            allowed="recordings of one machine with a drawing",
            next_step="give the recordings of one machine, or its configuration with --machine",
        )
    return model


def _check_rows(poses: Sequence[MeasuredPoses]) -> None:
    values = [int(one.use.sum()) * one.aligned.measured_mm.shape[1] for one in poses]
    numbers = [one.aligned.registration_columns.shape[2] for one in poses]
    problems = [
        Problem(
            str(one.aligned.recording.path),
            "has too few poses",
            value=f"{own} measured values for {count} numbers of the registration",
            allowed="more values than these numbers, by 6 or more",
            next_step="measure more poses; `compd recording check` says which rows are left out",
        )
        for one, own, count in zip(poses, values, numbers, strict=True)
        if own < count + 6
    ]
    rows = sum(int(one.use.sum()) for one in poses)
    if not problems and rows < FEWEST_ROWS:
        problems.append(
            Problem(
                ", ".join(str(one.aligned.recording.path) for one in poses),
                "has too few poses",
                value=f"{rows} rows with a pose and every value",
                allowed=f"{FEWEST_ROWS} or more: of {PARTS} parts each is predicted from the others",
                next_step="measure more poses: `compd plan --calibrate` chooses them",
            )
        )
    if problems:
        raise CompdError(problems)


def _once(parts: Sequence[Fold]) -> list[Fold]:
    """The first deal of random parts, in which each row is left out once."""
    random = [one for one in parts if not one.regions]
    return random[: len(random) // 2]


def _in_units(parameters: Parameters, covariance: FloatArray) -> FloatArray:
    return np.asarray(covariance * np.outer(parameters.per_theta, parameters.per_theta))


def _numbers(
    parameters: Parameters, fit: MachineFit, selection: Selection, prior: FloatArray
) -> tuple[CalibratedNumber, ...]:
    """prior : (P,) standard deviations before, in tolerances."""
    std = np.sqrt(np.diag(fit.result.C))
    correlation = fit.result.C / np.outer(std, std)
    np.fill_diagonal(correlation, 0.0)
    correlation[:, ~fit.free] = 0.0
    value = fit.theta * parameters.per_theta
    unit = parameters.prior_std * parameters.per_theta
    needed = np.isin(parameters.block_of, selection.needed)
    numbers = []
    for k, name in enumerate(parameters.names):
        other = int(np.abs(correlation[k]).argmax())
        size = float(correlation[k, other]) if fit.free[k] else 0.0
        numbers.append(
            CalibratedNumber(
                name=name,
                block=name.split(".")[0],
                element=parameters.elements[k],
                unit=parameters.units[k],
                drawing=float(parameters.drawing[k]),
                value=float(parameters.drawing[k] + value[k]),
                std=float(std[k] * unit[k]),
                prior_std=float(prior[k] * unit[k]),
                correlation=size,
                with_whom=parameters.elements[other] if size else "",
                needed=bool(needed[k]),
                held=bool(not fit.free[k] or std[k] > CalibrationCriteria.told_share * prior[k]),
            )
        )
    return tuple(numbers)


def _blocks(
    parameters: Parameters, selection: Selection, untested: dict[int, str], as_drawn: list[int]
) -> tuple[TriedBlock, ...]:
    tried = []
    for b, block in enumerate(parameters.blocks):
        without, with_it = (rms(np.sqrt(list(one[b]))) for one in (selection.without, selection.with_it))
        needed = b in selection.needed
        why = "the poses show it as drawn"
        if b not in as_drawn:
            how = "worse" if needed else "as well"
            why = f"held-out poses are predicted {how} without"
        tried.append(TriedBlock(block.effect.id, block.words, needed, without, with_it, untested.get(b, why)))
    return tuple(tried)


def _gross(fit: MachineFit) -> tuple[GrossPose, ...]:
    gross = []
    for now, outlier in zip(fit.now, fit.outlier, strict=True):
        left_mm = registered_mm(now, now.use & ~outlier)[1][:, now.aligned.lengths]
        recording = now.aligned.recording
        gross += [
            GrossPose(recording.path.name, int(recording.row[k]), float(np.linalg.norm(left_mm[k])))
            for k in np.flatnonzero(outlier)
        ]
    return tuple(gross)


def _noise_um(fit: MachineFit) -> tuple[float, float]:
    """Of lengths and of angles, from repeats or as declared, over all recordings; nan where one does not say it."""
    lengths, angles = [], []
    for now in fit.now:
        floor = compare(now.aligned).floor
        by_axis = floor.by_axis_um if floor.known else np.full(now.residual_mm.shape[1], np.nan)
        lengths.append(rms(by_axis[now.aligned.lengths]))
        angles.append(rms(by_axis[-3:]) if now.aligned.with_attitude else np.nan)
    return float(np.sqrt(np.mean(np.square(lengths)))), float(np.sqrt(np.mean(np.square(angles))))


def _warnings(
    model: MachineModel, parameters: Parameters, fit: MachineFit, untested: Untested, tolerance_mm: float
) -> tuple[str, ...]:
    said = [f"{parameters.blocks[b].words}: {why}" for b, why in untested.blocks.items()]
    if untested.thin:
        said.append(f"{'; '.join(untested.thin)}: how far the prediction errs elsewhere, no pose of these tests.")
    if np.isnan(tolerance_mm):
        said.append(
            "the machine states no tolerance: numbers may leave the drawing by what the library thinks plausible. "
            "Write `tolerance_mm` under `geometry:`."
        )
    if not length_scale_is_told(model, parameters, fit.normal):
        said.append(
            "these measurements hold no scale of length: if all places and lengths were larger by one share, nothing "
            "would show. One known length tells it, such as a calibrated bar between two places of the tip."
        )
    for now, sigma_mm in zip(fit.now, fit.sigma_mm, strict=True):
        times = rms(sigma_mm[now.aligned.lengths]) / rms(declared_mm(now, len(sigma_mm))[now.aligned.lengths])
        if times >= CalibrationCriteria.much_left:
            said.append(
                f"{now.aligned.recording.path.name}: these numbers leave {times:.0f} times the noise that its sidecar "
                "declares. Something else moves the tip or the instrument; until it is found the numbers may be wrong."
            )
    values = sum(len(part.z) for part in fit.linear)
    numbers = int(fit.free.sum()) + sum(part.R.shape[1] for part in fit.linear)
    if values < 2 * numbers:
        said.append(
            f"{values} measured values for {numbers} numbers: the standard errors rest on few degrees of freedom; "
            "measure more poses."
        )
    return tuple(said)
