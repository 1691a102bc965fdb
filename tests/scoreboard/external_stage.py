"""A linear stage whose display has steps, simulated part by part, and not by the formulas of its effects."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import shipped_effects
from tests.scoreboard.case import Case
from tests.scoreboard.external_machine import UM, ExternalMachine, Recorded, rounded, sidecar

# Of the stage: least and most, mm and um; places and runs; a reading's noise over the step of the display.
TRAVEL_MM, PLACES, RUNS, STEPS_UM = (60, 200), (8, 16), (3, 6), (0.1, 0.5, 1.0)
NOISE_IN_STEPS, OFFSET_UM = (0.02, 0.25), 40.0
# What is true of a place and of no other, rms over the step: dust, balls that return, a grating's lines.
UNEVEN_IN_STEPS = 0.4
READINGS, STOP_S, READING_S = 2, 15.0, 2.0


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
        else rounded(shape * floors * step_um / np.sqrt(12) / np.std(made))
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
    return Recorded(columns, sidecar(), {name: strength * unit}, float(np.std(shown_um - named_um)))


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


STAGE = ExternalMachine(
    ("stage_backlash", "stage_gain", "stage_bow", "stage_windup"),
    ("stage_offset",),
    shipped_effects()["stage"],
    "as its formula",
    record_stage,
)
