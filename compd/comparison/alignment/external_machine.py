"""A machine that an external model computes: its prediction, and what effects can be computed from.

Of such a machine compd knows what the user's model predicts and what was recorded beside it, and no kinematics. Where
link lengths were measured, link i is as much longer as its scale or the link itself adds; of a tip only what the
reference adds can be carried over.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.columns import is_sensitivity
from compd.comparison.alignment.velocity import velocities
from compd.comparison.criteria import SpeedCriteria
from compd.errors import RecordingError
from compd.model import Deltas, observe_external
from compd.model.effects import Observations
from compd.model.kinematics import Movement
from compd.recording import Recording
from compd.travel_direction import row_directions
from compd.units import REFERENCE_UNITS, UM_PER_MM


def external_prediction(recording: Recording) -> FloatArray:
    """(N, m) what the user's own model predicts for each measured coordinate."""
    predicted = recording.model_mm if recording.model_link_mm is None else recording.model_link_mm
    if predicted is None:
        raise RecordingError.of(
            str(recording.path),
            "`machine: external`, but no column of the model's prediction",
            allowed="model_x_mm ...",
            next_step="add the model's prediction, or name the machine",
        )
    return np.asarray(predicted)


def external_change(added: Deltas, coordinates: Sequence[int], of_links: bool) -> FloatArray:
    """(N, m, ...) by how much the prediction of the measured coordinates changes with (N, size, ...) at the ports.

    coordinates : axes of the tip or links, from 0.  of_links : whether link lengths were measured, not the tip; what
    the reference adds along its k-th axis is then added to link k.
    """
    any_port = next(iter(added.values()))
    change = np.zeros((len(any_port), len(coordinates), *any_port.shape[2:]))
    for port in ("scale", "link", "reference") if of_links else ("reference",):
        if port in added:
            shown = [k for k, coordinate in enumerate(coordinates) if coordinate < added[port].shape[1]]
            change[:, shown] += added[port][:, [coordinates[k] for k in shown]]
    return change


def external_observations(
    recording: Recording, starts: BoolArray, criteria: SpeedCriteria = SpeedCriteria()
) -> Observations:
    """Every row of the recording, as effects take it.

    Of links whose length was measured, columns `scale_<i>_mm`, `approach_<i>` and `velocity_<i>_mm_per_s` are the
    link's. Direction and velocity that were not recorded are found from the scales, the direction of any machine.

    starts : (N,) rows without a history.
    """
    links = max(recording.reference_links, default=0)
    quantities = {**recording.quantities, **_sensitivities_in_mm(recording), **_directions_from_scales(recording)}
    scale_mm, direction, velocity = (
        _of_links(quantities, name, recording.rows, links)
        for name in ("scale_{}_mm", "approach_{}", "velocity_{}_mm_per_s")
    )
    if links and recording.has_time and np.isnan(velocity).all():
        at_point = np.zeros(recording.rows, dtype=bool) if recording.point is None else recording.point >= 0
        velocity = velocities(recording.time_s, starts, at_point, scale_mm, np.zeros((recording.rows, 0)), criteria)
        velocity = np.where(np.isfinite(scale_mm), velocity, np.nan)
    readings = {"scale": scale_mm, "direction": direction, "motion": velocity}
    measured = [link - 1 for link in recording.reference_links]
    recorded = {
        name for name, values in readings.items() if links and np.isfinite(values[:, measured]).any(axis=0).all()
    }
    observed = observe_external(
        _external_tip(recording),
        scale_mm=scale_mm,
        movement=Movement(np.nan_to_num(direction), velocity, np.zeros((recording.rows, 0))),
        quantities=quantities,
        time_s=recording.elapsed_s,
        session_start=starts,
        recorded=frozenset(recorded | ({"time", "order"} if recording.has_time else set())),
    )
    return replace(observed, unit=recording.unit)


def _of_links(quantities: Mapping[str, FloatArray], name: str, rows: int, links: int) -> FloatArray:
    """(N, links) one column for each link, nan where it was not recorded.  name : with {} for the link's number."""
    unknown = np.full(rows, np.nan)
    columns = [quantities.get(name.format(i + 1), unknown) for i in range(links)]
    return np.stack(columns, axis=1) if columns else np.zeros((rows, 0))


def _sensitivities_in_mm(recording: Recording) -> dict[str, FloatArray]:
    """Columns `d_<name>_x_mm` (N,) of those in another unit of the reference, which counts as a micrometre."""
    ending = REFERENCE_UNITS[recording.unit]
    if ending == "mm":
        return {}
    return {
        f"{name.removesuffix(ending)}mm": values / UM_PER_MM
        for name, values in recording.quantities.items()
        if is_sensitivity(name) and name.endswith(f"_{ending}")
    }


def _directions_from_scales(recording: Recording) -> dict[str, FloatArray]:
    """Columns `approach_<i>` (N,) that were not recorded, from the scales that were; 0 before an axis has moved."""
    directions: dict[str, FloatArray] = {}
    for name, position_mm in recording.quantities.items():
        match = re.fullmatch(r"scale_([1-9]\d*)_mm", name)
        if match and f"approach_{match[1]}" not in recording.quantities:
            direction = row_directions(position_mm[:, None], recording.session)
            directions[f"approach_{match[1]}"] = np.nan_to_num(direction[:, 0])
    return directions


def _external_tip(recording: Recording) -> FloatArray:
    """(N, 3) the tip as far as the user's model predicts it; nan on the other axes."""
    tip = np.full((recording.rows, 3), np.nan)
    if recording.model_mm is not None:
        tip[:, ["xyz".index(axis) for axis in recording.reference_axes]] = recording.model_mm
    return tip
