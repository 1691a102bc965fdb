"""Two machines that compd does not know, simulated: a linear stage whose values come in steps, a gantry over a plate.

What they do is computed part by part, and not by the formulas of their effects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.configuration import shipped_effects
from tests.scoreboard.case import Case

UM = 1e-3
# Of the stage: least and most, mm and um; places and runs; a reading's noise over the step of the display.
TRAVEL_MM, PLACES, RUNS, STEPS_UM = (60, 200), (8, 16), (3, 6), (0.1, 0.5, 1.0)
NOISE_IN_STEPS, OFFSET_UM = (0.02, 0.25), 40.0
# What is true of a place and of no other, rms over the step: dust, balls that return, a grating's lines.
UNEVEN_IN_STEPS = 0.4
READINGS, STOP_S, READING_S = 2, 15.0, 2.0
# Of the gantry: half of its square, mm; places along each side; noise, um; tilt of the plate, um/m.
HALF_MM, SIDE, PLATE_NOISE_UM, TILT_UM_PER_M = 150.0, 7, (0.3, 1.0), 60.0
SESSIONS, PASSES, TOUCH_S, NIGHT_S = 2, 2, 30.0, 14 * 3600.0
BEAM_HALF_MM = 200.0
# Temperature of a column and of a probe: rise, K, and time constant, s; of the room's wave: K and s.
COLUMN_K, COLUMN_S, PROBE_K, PROBE_S, ROOM_K, ROOM_S = 4.0, 3000.0, 6.0, 500.0, 0.8, 5000.0
ZERO_degC = 20.0


class Recorded(NamedTuple):
    """A recording of a machine.

    strengths : of what was hidden, by effect, as its formula has them. left_um : what no analysis can take away, rms.
    """

    columns: dict[str, FloatArray]
    sidecar: dict[str, Any]
    strengths: dict[str, float]
    left_um: float


@dataclass(frozen=True)
class ExternalMachine:
    """causes : that can be hidden in it, ids of its effects. constants : ids of effects that are always there.

    effects : the file that declares them. record : the recording of a case with this number.
    """

    causes: tuple[str, ...]
    constants: tuple[str, ...]
    effects: Path
    unit: str
    record: Callable[[Case, int], Recorded]


def machine_of(case: Case) -> ExternalMachine | None:
    """The external machine of a case; None for one that compd knows."""
    return next((machine for machine in MACHINES if case.causes and case.causes[0] in machine.causes), None)


# --- the stage ------------------------------------------------------------------------------------------


def record_stage(case: Case, number: int) -> Recorded:
    """Even places approached from both sides, and a display whose step is larger than what the axis scatters."""
    rng = case.rng("stage")
    step_um = float(rng.choice(STEPS_UM))
    travel_mm, places = int(rng.integers(*TRAVEL_MM)), int(rng.integers(*PLACES))
    noise_um = step_um * rng.uniform(*NOISE_IN_STEPS)
    offset_um = rng.uniform(-OFFSET_UM, OFFSET_UM)
    shape = rng.choice((-1.0, 1.0))
    rng = case.rng(f"stage {number}")
    distance_mm = max(travel_mm // places, 1)
    upwards = np.arange(places + 1.0) * distance_mm + number * distance_mm // 2
    run = _there_and_back(upwards)
    direction = np.repeat((1.0, -1.0), places + 1)
    runs = int(rng.integers(*RUNS))
    place_mm, moved = np.tile(run, runs), np.tile(direction, runs)
    (name,), (floors,) = case.causes, case.floors
    made, unit = _stage_error(name, place_mm, moved)
    # the same cause on all days, sized by the first
    strength = (
        record_stage(case, 0).strengths[name] / unit
        if number
        else _rounded(shape * floors * step_um / np.sqrt(12) / np.std(made))
    )
    uneven_um = np.tile(_there_and_back(rng.normal(0, UNEVEN_IN_STEPS * step_um, places + 1)), runs)
    named_um = np.repeat(offset_um + strength * made, READINGS)
    error_um = named_um + np.repeat(uneven_um, READINGS) + rng.normal(0, noise_um, len(named_um))
    shown_um = np.round(error_um / step_um) * step_um
    stop = np.repeat(np.arange(len(place_mm)), READINGS)
    model_mm = place_mm[stop]
    columns = {
        "time_s": stop * STOP_S + np.tile(np.arange(READINGS) * READING_S, len(place_mm)),
        "session": 1.0 + stop // len(run),
        "visit": 1.0 + stop,
        "approach_1": moved[stop],
        "model_x_mm": model_mm,
        "reference_x_mm": np.round(model_mm + UM * shown_um, 6),
    }
    return Recorded(columns, _sidecar(), {name: strength * unit}, float(np.std(shown_um - named_um)))


def _there_and_back(values: FloatArray) -> FloatArray:
    return np.concatenate([values, values[::-1]])


def _stage_error(name: str, place_mm: FloatArray, moved: FloatArray) -> tuple[FloatArray, float]:
    """Error (N,) in um of the cause at size 1, and the strength that its formula has then."""
    if name == "stage_backlash":
        # every place is overrun and approached anew, so that the nut has crossed the play of 1 um
        return -moved / 2, -1.0
    if name == "stage_gain":
        return place_mm / 1000, 1.0
    if name == "stage_bow":
        return np.square(place_mm / 100), 1e-4
    # the screw between motor and nut is twisted by friction against the motion
    return -moved * place_mm / 1000, -1.0


# --- the gantry -----------------------------------------------------------------------------------------


def record_bed(case: Case, number: int) -> Recorded:
    """A plate that is touched from above place by place, twice a day: the height of the plate is the reference."""
    rng = case.rng("bed")
    noise_um = rng.uniform(*PLATE_NOISE_UM)
    tilt = rng.uniform(-TILT_UM_PER_M, TILT_UM_PER_M, 2) / 1000
    offset_um, sign = rng.uniform(-OFFSET_UM, OFFSET_UM), rng.choice((-1.0, 1.0))
    rng = case.rng(f"bed {number}")
    side = np.linspace(-HALF_MM, HALF_MM, SIDE)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    order = np.concatenate([rng.permutation(len(x)) for _ in range(SESSIONS * PASSES)])
    x, y = x[order], y[order]
    session = np.repeat(np.arange(SESSIONS), PASSES * SIDE**2)
    in_session_s = np.tile(np.arange(PASSES * SIDE**2) * TOUCH_S, SESSIONS)
    column, probe, room = _temperatures(rng, session, in_session_s)
    (name,), (floors,) = case.causes, case.floors
    made, unit, signed = _bed_error(name, x, y, column, probe)
    strength = (
        record_bed(case, 0).strengths[name] / unit
        if number
        else _rounded((sign if signed else 1.0) * floors * noise_um / np.std(made))
    )
    # how much lower the machine believes to be than it is
    error_um = offset_um + tilt[0] * x + tilt[1] * y + strength * made
    noise = rng.normal(0, noise_um, len(x))
    columns = {
        "time_s": session * NIGHT_S + in_session_s,
        "session": 1.0 + session,
        "visit": 1.0 + np.arange(len(x)),
        "nominal_x_mm": x,
        "nominal_y_mm": y,
        "temperature_column_degC": np.round(column, 2),
        "temperature_probe_degC": np.round(probe, 2),
        "temperature_room_degC": np.round(room, 2),
        "model_z_mm": np.round(-UM * (error_um + noise), 6),
        "reference_z_mm": np.zeros(len(x)),
    }
    left_um = float(np.sqrt(np.mean(noise**2)))
    return Recorded(columns, _sidecar(), {name: strength * unit}, left_um)


def _temperatures(rng: np.random.Generator, session: IntArray, in_session_s: FloatArray) -> tuple[FloatArray, ...]:
    """Column, probe and room: each day both warm up, by another amount, and follow the room."""
    phase, share = rng.uniform(0, 2 * np.pi, SESSIONS)[session], rng.uniform(0.4, 1.0, (2, SESSIONS))[:, session]
    room = ZERO_degC + ROOM_K * np.sin(2 * np.pi * in_session_s / ROOM_S + phase)
    column = ZERO_degC + share[0] * COLUMN_K * -np.expm1(-in_session_s / COLUMN_S) + 0.5 * (room - ZERO_degC)
    probe = ZERO_degC + share[1] * PROBE_K * -np.expm1(-in_session_s / PROBE_S) + 0.7 * (room - ZERO_degC)
    return column, probe, room


def _bed_error(
    name: str, x: FloatArray, y: FloatArray, column: FloatArray, probe: FloatArray
) -> tuple[FloatArray, float, bool]:
    """Error (N,) in um at size 1, the strength that its formula has then, and whether it may have either sign."""
    from_end, length = x + BEAM_HALF_MM, 2 * BEAM_HALF_MM
    errors: Mapping[str, tuple[FloatArray, float, bool]] = {
        # under a load that moves, the compliance of a beam on two supports: a^2 b^2 / (3 E I l)
        "gantry_sag": (-(from_end**2) * (length - from_end) ** 2 / BEAM_HALF_MM**4, 1.0, False),
        "bed_twist": (x / 100 * (y / 100), 1.0, True),
        "rail_bow": (y * y / BEAM_HALF_MM**2, 1.0, True),
        "column_growth": (column - ZERO_degC, 1.0, False),
        "probe_growth": (ZERO_degC - probe, 1.0, False),
    }
    return errors[name]


def _sidecar() -> dict[str, Any]:
    """No uncertainty is declared: nobody knows it."""
    return {"format": 2, "machine": "external", "reference": {"quantity": "tool_position", "frame": "machine"}}


def _rounded(strength: np.floating[Any]) -> float:
    return float(f"{strength:.6g}")


STAGE = ExternalMachine(
    ("stage_backlash", "stage_gain", "stage_bow", "stage_windup"),
    ("stage_offset",),
    shipped_effects()["stage"],
    "as its formula",
    record_stage,
)
BED = ExternalMachine(
    ("gantry_sag", "bed_twist", "rail_bow", "column_growth", "probe_growth"),
    ("bed_offset", "bed_tilt"),
    Path(__file__).with_name("bed_effects.yaml"),
    "as its formula",
    record_bed,
)
MACHINES = (STAGE, BED)
