"""What could be measured next on a machine whose kinematics is known: short programmes of rows, one purpose each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.errors import RecordingError
from compd.link_count import scale_count
from compd.model import MachineModel, observe
from compd.model.effects import Effect, MachineConstants, Observations, needed_quantities
from compd.model.kernels import Reason
from compd.model.kinematics import Movement
from compd.plan_file import plan_row
from compd.planning.programme_rows import ProgrammeRows, programme_starts, reversals_mm, step_times_s
from compd.reference_conditions import REFERENCE_TEMPERATURE_degC

# Places along each edge of the workspace's box.
PLACES_PER_EDGE = 3
# Loads as shares of the largest: a straight line and a curve differ in the middle.
LOADS = (1 / 6, 1 / 2, 1.0)
# Speeds as shares of the fastest.
SPEEDS = (0.25, 1.0)
ROW_EVERY_S = 30.0
# Quantiles of the recorded positions that bound the workspace, so that no single row stretches it.
WORKSPACE_QUANTILES = (0.02, 0.98)


class ProgrammeLimits(NamedTuple):
    """Limits that the next measurement has to keep.

    tip_low_M_mm, tip_high_M_mm : (3,) opposite corners of the workspace.  force_N : largest, along any axis.
    temperature_degC : lowest and highest.  speed_mm_per_s : fastest.
    wait_s : longest time for which a step of temperature may be observed.
    """

    tip_low_M_mm: FloatArray
    tip_high_M_mm: FloatArray
    force_N: float
    temperature_degC: tuple[float, float]
    speed_mm_per_s: float
    wait_s: float = 7200.0


@dataclass(frozen=True)
class Programme:
    """R rows that are measured one after the other.

    tip_M_mm : (R, 3).  time_s : (R,) from its start.
    direction : (R, n) of travel of each link; all 0 where it follows from the positions.
    velocity_mm_per_s : (R, n) of the links.
    quantities : name -> (R,) what differs from the machine at rest in a room at the reference temperature.
    """

    purpose: str
    tip_M_mm: FloatArray
    time_s: FloatArray
    direction: FloatArray
    velocity_mm_per_s: FloatArray
    quantities: Mapping[str, FloatArray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.tip_M_mm)


def recorded_limits(aligned: AlignedRecording) -> ProgrammeLimits:
    """Limits within which a recording stayed: what was reached there can be reached again."""
    usable = aligned.usable.mask
    tip = aligned.rows.tip_M_mm[usable]
    quantities = aligned.recording.quantities
    forces = [np.abs(quantities[f"force_{axis}_N"][usable]) for axis in "xyz" if f"force_{axis}_N" in quantities]
    temperatures = [values[usable] for name, values in quantities.items() if name.startswith("temperature_")]
    speed = np.nanmax(np.abs(aligned.rows.velocity_mm_per_s[usable]), initial=0.0)
    low, high = WORKSPACE_QUANTILES
    return ProgrammeLimits(
        tip_low_M_mm=np.quantile(tip, low, axis=0),
        tip_high_M_mm=np.quantile(tip, high, axis=0),
        force_N=float(np.nanmax(forces)) if forces else 0.0,
        temperature_degC=(float(np.nanmin(temperatures)), float(np.nanmax(temperatures)))
        if temperatures
        else (REFERENCE_TEMPERATURE_degC,) * 2,
        speed_mm_per_s=float(speed),
    )


def machine_programmes(aligned: AlignedRecording, effects: Sequence[Effect], limits: ProgrammeLimits) -> ProgrammeRows:
    """The programmes within the limits that vary what `effects` are computed from.

    Raises RecordingError where a place within the limits cannot be reached.
    """
    assert aligned.model is not None
    names = list(dict.fromkeys(name for effect in effects for name in needed_quantities(effect, aligned.rows.links)))
    possible = list(_programmes(aligned, limits, names))
    observations = _observe_programmes(aligned.model, aligned.rows.constants, possible, aligned)
    purposes = [programme.purpose for programme in possible for _ in range(len(programme))]
    # lists, of which single numbers are taken faster than of arrays
    time_s, tip_M_mm, direction = (
        values.tolist() for values in (observations.time_s, observations.tip_M_mm, observations.direction)
    )
    speed_mm_per_s = np.abs(observations.velocity_mm_per_s).max(axis=1).tolist()
    held = {name: observations.quantities[name].tolist() for name in names}
    to_set = [
        plan_row(
            purpose,
            time_s[k],
            tip_M_mm[k],
            {name: values[k] for name, values in held.items()},
            direction[k],
            speed_mm_per_s[k],
        )
        for k, purpose in enumerate(purposes)
    ]
    return ProgrammeRows(observations, np.array([len(programme) for programme in possible]), to_set)


def _programmes(aligned: AlignedRecording, limits: ProgrammeLimits, names: Sequence[str]) -> Iterator[Programme]:
    """Programmes that vary one thing each: place, load, temperature, another quantity, direction, speed, time.

    names : the quantities that the rivals need; others stay as they are.
    """
    n = scale_count(aligned.rows.links)
    edges = [
        np.linspace(low, high, PLACES_PER_EDGE)
        for low, high in zip(limits.tip_low_M_mm, limits.tip_high_M_mm, strict=True)
    ]
    places = np.stack(np.meshgrid(*edges), axis=-1).reshape(-1, 3)
    middle = (limits.tip_low_M_mm + limits.tip_high_M_mm) / 2
    few_places = (middle, *places[:: len(places) // 4])
    for place in places:
        for sign in (1.0, -1.0):
            yield Programme(
                "place, approached from one side", place[None], np.zeros(1), np.full((1, n), sign), np.zeros((1, n))
            )
    if limits.force_N > 0 and any(name.startswith("force_") for name in names):
        loads_N = limits.force_N * np.array([share * sign for share in LOADS for sign in (1.0, -1.0)])
        for place in few_places:
            for axis in "xyz":
                yield _programme_at(place, n, f"load along {axis} in steps", {f"force_{axis}_N": loads_N})
    low, high = limits.temperature_degC
    for group in _temperature_groups([name for name in names if name.startswith("temperature_")]):
        for place in few_places:
            for value in (low, high):
                temperatures = {name: np.array([value]) for name in group}
                yield _programme_at(place, n, "one part warm or cold alone", temperatures)
        times_s = step_times_s(limits.wait_s)
        step = np.where(times_s > 0, high, low)
        yield _programme_at(middle, n, "a step of temperature, watched", dict.fromkeys(group, step), times_s)
    for name in names:
        if not name.startswith(("temperature_", "force_")):
            column = aligned.recording.quantities[name]
            ends = np.array([np.nanmin(column), np.nanmax(column)])
            for place in few_places:
                yield _programme_at(place, n, f"{name} low and high", {name: ends})
    yield from _motion_programmes(middle, n, limits)
    yield _programme_at(middle, n, "the same place again later", {}, np.array([0.0, limits.wait_s]))


def _programme_at(
    place: FloatArray, n: int, purpose: str, quantities: Mapping[str, FloatArray], time_s: FloatArray | None = None
) -> Programme:
    """A programme at one place (3,), at rest; as many rows as the quantities have values, or else times."""
    count = len(next(iter(quantities.values()))) if quantities else 0 if time_s is None else len(time_s)
    times_s = _row_times_s(count) if time_s is None else time_s
    tip_M_mm = np.tile(place, (count, 1))
    return Programme(purpose, tip_M_mm, times_s, np.ones((count, n)), np.zeros((count, n)), quantities)


def _motion_programmes(middle: FloatArray, n: int, limits: ProgrammeLimits) -> Iterator[Programme]:
    """Reversals in growing steps, and rows on the move, along each axis."""
    half_edge_mm = (limits.tip_high_M_mm - limits.tip_low_M_mm) / 2
    for axis in range(3):
        unit = np.eye(3)[axis]
        path_mm = reversals_mm(half_edge_mm[axis])
        count = len(path_mm)
        # the directions of the links follow from their lengths, once these are known
        yield Programme(
            "reversals in growing steps",
            middle + path_mm[:, None] * unit,
            _row_times_s(count),
            np.zeros((count, n)),
            np.zeros((count, n)),
        )
        if limits.speed_mm_per_s > 0:
            speeds = limits.speed_mm_per_s * np.array([sign * share for share in SPEEDS for sign in (1.0, -1.0)])
            count = len(speeds)
            of_links = np.repeat(speeds[:, None], n, axis=1)
            yield Programme(
                "passing at speed, both ways",
                np.tile(middle, (count, 1)),
                _row_times_s(count),
                np.sign(of_links),
                of_links,
            )


def _row_times_s(count: int) -> FloatArray:
    return np.asarray(ROW_EVERY_S * np.arange(count, dtype=np.float64))


def _temperature_groups(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Temperatures that are changed together: all links; every other part alone."""
    links = tuple(name for name in names if "_link_" in name)
    return [*([links] if links else []), *((name,) for name in names if name not in links)]


def _observe_programmes(
    model: MachineModel, constants: MachineConstants, chosen: Sequence[Programme], aligned: AlignedRecording
) -> Observations:
    """The programmes as rows that effects can be computed on, each a session of its own, with perfect gauges.

    aligned : the recording that gives the quantities' values at rest.
    Raises RecordingError where a place cannot be reached.
    """
    tip = np.concatenate([programme.tip_M_mm for programme in chosen])
    count = len(tip)
    pose, scale_mm = model.reach(tip)
    if (pose.reason != Reason.OK).any():
        unreachable = tip[pose.reason != Reason.OK][0]
        raise RecordingError.of(
            "the next measurement",
            "a place within the limits is out of reach",
            value=str(np.round(unreachable, 1).tolist()),
            next_step="narrow the workspace with --workspace",
        )
    starts = programme_starts(np.array([len(programme) for programme in chosen]))
    direction = np.concatenate([programme.direction for programme in chosen])
    travel_mm = np.diff(scale_mm, axis=0, prepend=scale_mm[:1])
    follows = (direction == 0).all(axis=1)
    direction[follows] = np.where(starts[:, None], 1.0, np.sign(travel_mm))[follows]
    velocity = np.concatenate([programme.velocity_mm_per_s for programme in chosen])
    quantities = {name: np.full(count, value) for name, value in _values_at_rest(aligned).items()}
    for programme, begin in zip(chosen, np.flatnonzero(starts), strict=True):
        for name, values in programme.quantities.items():
            quantities[name][begin : begin + len(programme)] = values
    comparators = model.joint_weights.shape[1]
    return observe(
        model,
        constants,
        scale_mm=scale_mm,
        joint_mm=np.zeros((count, comparators)),
        frame_mm=np.zeros((count, 9)),
        quantities=quantities,
        time_s=np.concatenate([programme.time_s for programme in chosen]),
        session_start=starts,
        movement=Movement(direction, velocity, np.zeros((count, comparators))),
        quantities_at_zero=aligned.rows.quantities_at_zero,
    )


def _values_at_rest(aligned: AlignedRecording) -> dict[str, float]:
    """Every quantity of the recording where nothing acts: the temperatures of machine zero, where they are not known 20
    degC; no force, the median of the rest."""
    rest = {}
    at_zero = aligned.rows.quantities_at_zero or {}
    for name, values in aligned.recording.quantities.items():
        if name.startswith("temperature_"):
            rest[name] = at_zero.get(name, REFERENCE_TEMPERATURE_degC)
        else:
            rest[name] = 0.0 if name.startswith("force_") else float(np.nanmedian(values))
    return rest
