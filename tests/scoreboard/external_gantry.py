"""A gantry that touches a granite plate, simulated part by part."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray, IntArray
from tests.scoreboard.case import Case
from tests.scoreboard.external_machine import UM, ExternalMachine, Recorded, rounded, sidecar

# Of the gantry: half of its square, mm; places along each side; noise, um; tilt of the plate, um/m.
HALF_MM, SIDE, PLATE_NOISE_UM, TILT_UM_PER_M = 150.0, 7, (0.3, 1.0), 60.0
SESSIONS, PASSES, TOUCH_S, NIGHT_S = 2, 2, 30.0, 14 * 3600.0
OFFSET_UM = 40.0
BEAM_HALF_MM = 200.0
# Temperature of a column and of a probe: rise, K, and time constant, s; of the room's wave: K and s.
COLUMN_K, COLUMN_S, PROBE_K, PROBE_S, ROOM_K, ROOM_S = 4.0, 3000.0, 6.0, 500.0, 0.8, 5000.0
ZERO_degC = 20.0


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
        else rounded((sign if signed else 1.0) * floors * noise_um / np.std(made))
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
    return Recorded(columns, sidecar(), {name: strength * unit}, left_um)


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


BED = ExternalMachine(
    ("gantry_sag", "bed_twist", "rail_bow", "column_growth", "probe_growth"),
    ("bed_offset", "bed_tilt"),
    Path(__file__).with_name("bed_effects.yaml"),
    "as its formula",
    record_bed,
)
