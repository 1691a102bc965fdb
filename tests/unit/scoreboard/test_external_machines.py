"""The stage and the gantry err as the formulas of their effects say, and by nothing else than what is stated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from compd.model.library import load_effects
from tests.scoreboard.case import Case
from tests.scoreboard.external_gantry import BED
from tests.scoreboard.external_machines import MACHINES, machine_of
from tests.scoreboard.external_printer import PRINTER
from tests.scoreboard.external_stage import STAGE
from tests.scoreboard.hard_cases import ONE_WARM_UP, PLANE, ROUNDED

CASES = [
    *(Case(ROUNDED, (cause,), (8.0,), 11 + k) for k, cause in enumerate(STAGE.causes)),
    *(Case(PLANE, (cause,), (8.0,), 21 + k) for k, cause in enumerate(BED.causes)),
    *(Case(ONE_WARM_UP, (cause,), (8.0,), 31 + k) for k, cause in enumerate(PRINTER.causes)),
]


def error_um(columns):
    axis = "x" if "model_x_mm" in columns else "z"
    return 1000 * (columns[f"reference_{axis}_mm"] - columns[f"model_{axis}_mm"])


def basis(cause, columns):
    """What the cause's formula says at strength 1, written here once more."""
    get = columns.get
    return {
        "stage_backlash": lambda: get("approach_1") / 2,
        "stage_gain": lambda: get("model_x_mm") / 1000,
        "stage_bow": lambda: get("model_x_mm") ** 2,
        "stage_windup": lambda: get("approach_1") * get("model_x_mm") / 1000,
        "gantry_sag": lambda: -((1 - (get("nominal_x_mm") / 200) ** 2) ** 2),
        "bed_twist": lambda: get("nominal_x_mm") * get("nominal_y_mm") / 1e4,
        "rail_bow": lambda: (get("nominal_y_mm") / 200) ** 2,
        "column_growth": lambda: get("temperature_column_degC") - 20,
        "probe_growth": lambda: 20 - get("temperature_probe_degC"),
        "bed_growth": lambda: get("temperature_bed_degC"),
        "frame_growth": lambda: get("temperature_frame_degC"),
    }[cause]()


def left_um(case, columns, strength):
    """Root mean square without the cause and the constants."""
    rest = error_um(columns) - strength * basis(case.causes[0], columns)
    fixed = [np.ones_like(rest)]
    if case.family == PLANE:
        fixed += [columns["nominal_x_mm"], columns["nominal_y_mm"]]
    fixed = np.column_stack(fixed)
    rest = rest - fixed @ np.linalg.lstsq(fixed, rest, rcond=None)[0]
    return np.sqrt(np.mean(rest**2))


NOT_LATE = [case for case in CASES if not case.causes[0].endswith("_lag")]


@pytest.mark.parametrize("case", NOT_LATE, ids=lambda case: case.causes[0])
def test_what_is_hidden_is_what_its_formula_says(case):
    recorded = machine_of(case).record(case, 0)
    (strength,) = recorded.strengths.values()
    assert left_um(case, recorded.columns, strength) == pytest.approx(recorded.left_um, rel=0.15)
    assert left_um(case, recorded.columns, 0.0) > 2 * recorded.left_um


@pytest.mark.parametrize("case", NOT_LATE, ids=lambda case: case.causes[0])
def test_the_other_recording_has_other_rows_and_the_same_cause(case):
    first, other = (machine_of(case).record(case, number) for number in (0, 1))
    (strength,) = first.strengths.values()
    assert not np.array_equal(error_um(first.columns), error_um(other.columns))
    assert left_um(case, other.columns, strength) < 2 * first.left_um


@pytest.mark.parametrize("case", CASES[: len(STAGE.causes)], ids=lambda case: case.causes[0])
def test_the_stage_shows_steps_and_most_repeats_are_equal(case):
    shown = np.round(error_um(STAGE.record(case, 0).columns), 6)
    step = np.diff(np.unique(shown)).min()
    assert np.round(step, 6) in (0.1, 0.5, 1.0)
    assert np.abs(shown / step - np.round(shown / step)).max() < 1e-3
    assert np.mean(shown[::2] == shown[1::2]) > 0.5


@pytest.mark.parametrize("case", CASES[-len(PRINTER.causes) :], ids=lambda case: case.causes[0])
def test_a_warm_up_only_rises_but_for_the_room(case):
    columns = PRINTER.record(case, 0).columns
    for place in ("bed", "nozzle", "frame"):
        over_room = columns[f"temperature_{place}_degC"] - columns["temperature_room_degC"]
        assert np.diff(over_room).min() > -0.03
        assert over_room[-1] > over_room[0] + 2.0


def test_what_follows_the_bed_is_late_by_one_time_constant():
    (case,) = (case for case in CASES if case.causes == ("bed_growth_lag",))
    recorded = PRINTER.record(case, 0)
    time_s, bed = recorded.columns["time_s"], recorded.columns["temperature_bed_degC"]
    strength = recorded.strengths["bed_growth_lag"]

    def rest_um(tau_s):
        late = solve_ivp(
            lambda at_s, degC: (np.interp(at_s, time_s, bed) - degC) / tau_s,
            (0, time_s[-1]), [bed[0]], t_eval=time_s, max_step=20.0,
        ).y[0]  # fmt: skip
        return np.std(error_um(recorded.columns) - strength * late)

    assert min(map(rest_um, np.geomspace(300, 2000, 25))) == pytest.approx(recorded.left_um, rel=0.1)
    assert np.std(error_um(recorded.columns) - strength * bed) > 2 * recorded.left_um


def test_the_plate_is_at_one_height():
    assert set(BED.record(CASES[len(STAGE.causes)], 0).columns["reference_z_mm"]) == {0.0}


@pytest.mark.parametrize("machine", MACHINES)
def test_every_cause_and_constant_is_an_effect_of_the_machines_file(machine):
    assert {*machine.causes, *machine.constants} <= set(load_effects(machine.effects))
