"""What could be measured next: short programmes of rows, each with a purpose, within a person's limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.errors import Problem, RecordingError
from compd.model.kinematics import inverse_kinematics
from compd.model.machine import MachineModel
from compd.model.motion import Movement
from compd.model.observations import MachineConstants, Observations, REFERENCE_TEMPERATURE_degC
from compd.model.observe import observe
from compd.model.solve_status import Reason

# Places along each edge of the workspace's box.
PLACES = 3
# Loads as shares of the largest: a straight line and a curve differ in the middle.
LOADS = (1 / 6, 1 / 2, 1.0)
# A reversal builds up over a distance that nobody knows: from what a scale resolves to a hand's width.
REVERSALS_MM = (0.02, 0.1, 0.5, 2.0, 10.0, 30.0)
SPEEDS = (0.25, 1.0)
# Times after a step of temperature, as shares of the longest time that may be waited.
WATCHES = (0.0, 0.05, 0.15, 0.4, 1.0)
ROW_EVERY_S = 30.0
LINKS_TRAVEL_MM = 40.0


class ProgrammeLimits(NamedTuple):
    """Within what the next measurement has to stay.

    tip_low_M_mm, tip_high_M_mm : (3,).  force_N : largest, along any axis.  temperature_degC : lowest and highest.
    speed_mm_per_s : fastest.  wait_s : longest that a step of temperature may be watched.
    """

    tip_low_M_mm: FloatArray
    tip_high_M_mm: FloatArray
    force_N: float
    temperature_degC: tuple[float, float]
    speed_mm_per_s: float
    wait_s: float = 7200.0


@dataclass(frozen=True)
class Segment:
    """Rows that are measured one after the other.

    tip_M_mm (R, 3), time_s (R,) from its start, direction (R, n), velocity (R, n) of the links in mm/s.
    quantities : what differs from the machine at rest in a room at the reference temperature.
    """

    purpose: str
    tip_M_mm: FloatArray
    time_s: FloatArray
    direction: FloatArray
    velocity_mm_per_s: FloatArray
    quantities: Mapping[str, FloatArray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.tip_M_mm)


def limits_of(aligned: AlignedRecording) -> ProgrammeLimits:
    """Of the recording: what was reached there can be reached again."""
    usable, _ = aligned.usable
    tip = aligned.rows.tip_M_mm[usable]
    quantities = aligned.recording.quantities
    forces = [np.abs(quantities[f"force_{axis}_N"][usable]) for axis in "xyz" if f"force_{axis}_N" in quantities]
    warm = [v[usable] for name, v in quantities.items() if name.startswith("temperature_")]
    speed = np.nanmax(np.abs(aligned.rows.velocity_mm_per_s[usable]), initial=0.0)
    return ProgrammeLimits(
        np.quantile(tip, 0.02, axis=0),
        np.quantile(tip, 0.98, axis=0),
        float(np.nanmax(forces)) if forces else 0.0,
        (float(np.nanmin(warm)), float(np.nanmax(warm))) if warm else (REFERENCE_TEMPERATURE_degC,) * 2,
        float(speed),
    )


def segments(aligned: AlignedRecording, limits: ProgrammeLimits, names: Sequence[str]) -> Iterator[Segment]:
    """Programmes that vary one thing each; names : the quantities that the rivals need."""
    n = aligned.rows.links
    grid = [np.linspace(low, high, PLACES) for low, high in zip(limits.tip_low_M_mm, limits.tip_high_M_mm, strict=True)]
    places = np.stack(np.meshgrid(*grid), axis=-1).reshape(-1, 3)
    middle = (limits.tip_low_M_mm + limits.tip_high_M_mm) / 2
    still = np.zeros((1, n))
    for place in places:
        for sign in (1.0, -1.0):
            yield Segment("place, approached from one side", place[None], np.zeros(1), np.full((1, n), sign), still)
    if limits.force_N > 0 and any(name.startswith("force_") for name in names):
        for place in (middle, *places[:: len(places) // 4]):
            for axis in "xyz":
                loads = limits.force_N * np.array([share * s for share in LOADS for s in (1.0, -1.0)])
                yield _at(place, n, f"load along {axis} in steps", {f"force_{axis}_N": loads})
    warm = [name for name in names if name.startswith("temperature_")]
    low, high = limits.temperature_degC
    for group in _together(warm):
        for place in (middle, *places[:: len(places) // 4]):
            for value in (low, high):
                yield _at(place, n, "one part warm or cold alone", {name: np.array([value]) for name in group})
        watched = np.array([low, *[high] * len(WATCHES)])
        times = np.array([0.0, *(1.0 + limits.wait_s * share for share in WATCHES)])
        yield _at(middle, n, "a step of temperature, watched", dict.fromkeys(group, watched), times)
    for name in names:
        if not name.startswith(("temperature_", "force_")):
            column = aligned.recording.quantities[name]
            ends = np.array([np.nanmin(column), np.nanmax(column)])
            for place in (middle, *places[:: len(places) // 4]):
                yield _at(place, n, f"{name} low and high", {name: ends})
    yield from _moving(middle, n, limits)
    wait = np.array([0.0, limits.wait_s])
    yield _at(middle, n, "the same place again later", {}, wait)


def _at(
    place: FloatArray, n: int, purpose: str, quantities: Mapping[str, FloatArray], time_s: FloatArray | None = None
) -> Segment:
    count = len(next(iter(quantities.values()))) if quantities else 0 if time_s is None else len(time_s)
    times = _every(count) if time_s is None else time_s
    return Segment(purpose, np.tile(place, (count, 1)), times, np.ones((count, n)), np.zeros((count, n)), quantities)


def _moving(middle: FloatArray, n: int, limits: ProgrammeLimits) -> Iterator[Segment]:
    """Reversals in growing steps, and rows on the move, along each axis."""
    room = (limits.tip_high_M_mm - limits.tip_low_M_mm) / 2
    for axis in range(3):
        step = np.eye(3)[axis]
        sizes = [size for size in REVERSALS_MM if size <= room[axis]]
        path = np.array([0.0, *(s * size for size in sizes for s in (1.0, -1.0))])
        # the links' own directions follow from their lengths, once these are known
        yield Segment(
            "reversals in growing steps",
            middle + path[:, None] * step,
            _every(len(path)),
            np.zeros((len(path), n)),
            np.zeros((len(path), n)),
        )
        if limits.speed_mm_per_s > 0:
            speeds = limits.speed_mm_per_s * np.array([s * share for share in SPEEDS for s in (1.0, -1.0)])
            count = len(speeds)
            of_links = np.repeat(speeds[:, None], n, axis=1)
            yield Segment(
                "passing at speed, both ways", np.tile(middle, (count, 1)), _every(count), np.sign(of_links), of_links
            )


def _every(count: int) -> FloatArray:
    return np.asarray(ROW_EVERY_S * np.arange(count, dtype=np.float64))


def _together(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Links are warmed together; every other part alone."""
    links = tuple(name for name in names if "_link_" in name)
    return [*([links] if links else []), *((name,) for name in names if name not in links)]


def rows_of(
    model: MachineModel, common: MachineConstants, chosen: Sequence[Segment], aligned: AlignedRecording
) -> Observations:
    """The segments as rows that effects can see, each a session of its own, with perfect gauges.

    Raises RecordingError where a place cannot be reached.
    """
    tip = np.concatenate([one.tip_M_mm for one in chosen])
    count, zero = len(tip), model.zero
    pose = inverse_kinematics(model.mechanism(zero.base_joints_M_mm), tip, zero.contact.tip_P_mm, zero.rotation_M_P)
    if (pose.reason != Reason.OK).any():
        bad = tip[pose.reason != Reason.OK][0]
        raise RecordingError(
            Problem(
                where="the next measurement",
                what="a place within the limits is out of reach",
                value=str(np.round(bad, 1).tolist()),
                next_step="narrow the workspace with --workspace",
            )
        )
    scale_mm = pose.link_length_mm - zero.link_length_mm
    starts = np.zeros(count, dtype=bool)
    starts[np.cumsum([0, *(len(one) for one in chosen)])[:-1]] = True
    direction = np.concatenate([one.direction for one in chosen])
    moved = np.diff(scale_mm, axis=0, prepend=scale_mm[:1])
    own = (direction == 0).all(axis=1)
    direction[own] = np.where(starts[:, None], 1.0, np.sign(moved))[own]
    velocity = np.concatenate([one.velocity_mm_per_s for one in chosen])
    rest = _at_rest(aligned)
    quantities = {
        name: np.concatenate([np.broadcast_to(one.quantities.get(name, value), (len(one),)) for one in chosen])
        for name, value in rest.items()
    }
    comparators = model.joint_weights.shape[1]
    arguments: dict[str, Any] = {
        "scale_mm": scale_mm,
        "joint_mm": np.zeros((count, comparators)),
        "frame_mm": np.zeros((count, 9)),
        "quantities": quantities,
        "time_s": np.concatenate([one.time_s for one in chosen]),
        "session_start": starts,
        "movement": Movement(direction, velocity, np.zeros((count, comparators))),
    }
    return observe(model, common, **arguments)


def _at_rest(aligned: AlignedRecording) -> dict[str, float]:
    """Every quantity of the recording where nothing acts: 20 degC, no force, the middle of everything else."""
    found = {}
    for name, values in aligned.recording.quantities.items():
        if name.startswith("temperature_"):
            found[name] = REFERENCE_TEMPERATURE_degC
        else:
            found[name] = 0.0 if name.startswith("force_") else float(np.nanmedian(values))
    return found
