"""What a recording says does not depend on how it was written down: the diagnosis stays the same.

The same is the same word, the same set of effects, and numbers within one standard error. Recordings are small; the
machines are the tripod with effects of the library, and two that compd does not know. Long tests try the same on
campaigns of the simulated machine, which shares no code with the model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from compd.comparison import open_recording
from compd.configuration import load, shipped_configuration
from compd.diagnosis import Diagnosis, diagnose
from compd.model.library import find_effect, load_library
from compd.recording import write_recording
from compd.simulation.campaign.simulated_recording import simulate_recording
from compd.simulation.causes.hidden_cause import HiddenCause
from tests.support.changed_recordings import (
    Change,
    RecordingFile,
    add_constant,
    add_useless_columns,
    double_columns,
    double_rows,
    empty_cells,
    move_origin,
    move_rows,
    other_unit,
    read_file,
    reference_in,
    shuffle_columns,
    shuffle_rows,
    turn_frame,
)
from tests.support.hidden_effects import NOISE_UM, campaign, record_with_effects
from tests.support.own_machines import milling_table, rotary_axis
from tests.support.same_diagnosis import assert_same, effects_of

VISITS = 96
FLOORS_MOVED = 300.0
URAD_PER_MRAD = 1000.0
SINCE_1970_S = 1_795_000_000.0
CONSTANT = "a constant"
# Effects that add nothing but a constant to what the tripod's tip measures, or a constant and a little more.
MAKE_A_CONSTANT = {"reference_registration", "base_joint_position", "link_zero", "tool_offset"}

Make = Callable[[Path], RecordingFile]


class Case(NamedTuple):
    """A recording, what its diagnosis says, and the changes under which it stays the same.

    make : writes what it needs into a directory.
    """

    make: Make
    verdict: str
    effects: set[str]
    changes: Mapping[str, Change]


def tripod(seed: int, effects: Mapping[str, tuple[float, ...]], humidity: float = 0.0) -> Make:
    """A recording of the tripod with effects of the library; humidity : um/pct along z, less along x and y."""

    def make(directory: Path) -> RecordingFile:
        humid_um = humidity * (campaign(seed, VISITS)["humidity_pct"][:, None] - 50.0) * (0.3, -0.5, 1.0)
        record_with_effects(directory / "tripod.csv", seed, effects, extra_um=humid_um, visits=VISITS)
        return read_file(directory / "tripod.csv")

    return make


def simulated(seed: int, *causes: str) -> Make:
    """A campaign of the simulated tripod, in which each cause makes an error of three times the noise."""

    def make(directory: Path) -> RecordingFile:
        configuration = load(shipped_configuration("tripod-cmm.yaml"))
        recorded = simulate_recording(configuration, seed, [HiddenCause(cause, None, 3.0) for cause in causes])
        write_recording(directory / "campaign.csv", recorded.columns, recorded.sidecar, overwrite=True)
        return read_file(directory / "campaign.csv")

    return make


def by_instrument(make: Make) -> Make:
    """The same, measured in the frame of an instrument that stands beside the machine."""

    def made(directory: Path) -> RecordingFile:
        file = turn_frame(10.0, 3.0, 40.0, shift_mm=(600.0, -250.0, 30.0))(make(directory))
        reference = {**file.sidecar["reference"], "frame": "instrument"}
        return replace(file, sidecar={**file.sidecar, "reference": reference})

    return made


def everywhere(noise: float, axes: int, copied: str) -> dict[str, Change]:
    """Changes of any recording. noise : in um.  axes : that are measured.  copied : a quantity."""
    return {
        "rows in another order": shuffle_rows(1),
        "columns in another order": shuffle_columns(2),
        "seconds since 1970": move_origin(SINCE_1970_S),
        "rows twice": double_rows,
        "columns twice": double_columns,
        CONSTANT: add_constant(*(20 * noise, -14 * noise, 8 * noise)[:axes]),
        "useless columns": add_useless_columns(3, copied),
        "rows moved here and there": move_rows(4, 0.05, FLOORS_MOVED * noise),
        "a run of rows moved": move_rows(5, 0.05, FLOORS_MOVED * noise, as_run=True),
    }


TRIPOD = everywhere(NOISE_UM, 3, "temperature_room_degC") | {
    "empty cells of quantities": empty_cells(temperature_frame_degC=17, force_y_N=30, approach_1=50, visit=9),
    "empty cells of gauges": empty_cells(reference_y_mm=44, scale_2_mm=58, joint_4_um=70, frame_u2_um=77),
}
BY_INSTRUMENT = TRIPOD | {"a turned instrument": turn_frame(-70.0, 25.0, 133.0, shift_mm=(-40.0, 900.0, 12.0))}
TABLE = everywhere(1.0, 2, "spindle_degC") | {
    "empty cells": empty_cells(spindle_degC=11, nominal_y_mm=37, humidity_pct=60, reference_x_mm=90, visit=120),
    "a quantity in kelvin": other_unit("spindle_degC", "spindle_K", 1.0, 273.15),
    "a place in metres": other_unit("nominal_x_mm", "nominal_x_m", 0.001),
    "a quantity of no formula in newtons": other_unit("load_kg", "load_N", 9.80665),
}
TABLE_BY_INSTRUMENT = TABLE | {"a turned instrument": turn_frame(-133.0, shift_mm=(20.0, -70.0))}
AXIS = everywhere(1.0, 1, "moment_N_m") | {
    "empty cells": empty_cells(moved_1=11, temperature_housing_degC=37, reference_x_urad=90, visit=120),
    "the reference in another unit": reference_in("mrad", 1 / URAD_PER_MRAD),
}

CASES = {
    "one effect": Case(tripod(1, {"link_expansion": (1.5,)}), "identified", {"link_expansion"}, TRIPOD),
    "two effects": Case(
        tripod(2, {"link_elasticity": (1 / 30,), "scale_gain": (8.0, -6.0, 11.0)}),
        "identified",
        {"link_elasticity", "scale_gain"},
        TRIPOD,
    ),
    "nothing": Case(tripod(3, {}), "adequate", set(), TRIPOD),
    "outside the library": Case(tripod(4, {}, humidity=0.1), "unexplained", set(), TRIPOD),
    "by an instrument": Case(
        by_instrument(tripod(5, {"scale_gain": (8.0, -6.0, 11.0)})), "identified", {"scale_gain"}, BY_INSTRUMENT
    ),
    "table": Case(
        lambda _: milling_table(1, {"screw_expansion": 9.0, "backlash_x": 3.0}),
        "identified",
        {"screw_expansion", "backlash_x"},
        TABLE,
    ),
    "table by an instrument": Case(
        by_instrument(lambda _: milling_table(2, {"table_scale": 0.03, "table_squareness": 0.03})),
        "identified",
        {"table_scale", "table_squareness"},
        TABLE_BY_INSTRUMENT,
    ),
    "table, outside the formulas": Case(lambda _: milling_table(3, {"humidity": 0.8}), "unexplained", set(), TABLE),
    "rotary axis": Case(lambda _: rotary_axis(4, 4.0, 1.5), "identified", {"axis_play", "axis_windup"}, AXIS),
}
CAMPAIGNS = {
    "campaign, one effect": Case(simulated(11, "link_expansion"), "identified", {"link_expansion"}, TRIPOD),
    "campaign, two effects": Case(
        simulated(21, "link_elasticity", "backlash"), "identified", {"link_elasticity", "backlash"}, TRIPOD
    ),
    "campaign, nothing": Case(simulated(33), "adequate", set(), TRIPOD),
    "campaign, outside the library": Case(simulated(43, "air_pressure"), "unexplained", set(), TRIPOD),
    "campaign by an instrument": Case(
        by_instrument(simulated(13, "backlash")), "identified", {"backlash"}, BY_INSTRUMENT
    ),
}


def diagnose_file(file: RecordingFile, directory: Path) -> Diagnosis:
    effects = [find_effect(formula, "a test") for formula in file.formulas] or list(load_library().values())
    return diagnose(open_recording(file.write(directory / "run.csv")), (), None, effects)


class Original(NamedTuple):
    """A recording before it is changed."""

    case: Case
    file: RecordingFile
    diagnosis: Diagnosis


@pytest.fixture(scope="module")
def original_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Original]:
    """The original of a case by name; each is made and diagnosed once."""

    @cache
    def original(name: str) -> Original:
        case = (CASES | CAMPAIGNS)[name]
        directory = tmp_path_factory.mktemp("original")
        file = case.make(directory)
        return Original(case, file, diagnose_file(file, directory))

    return original


# Of `make test`; every case has its original to be made and diagnosed.
SAMPLE = "one effect"


def changes() -> Iterator[object]:
    for name, case in (CASES | CAMPAIGNS).items():
        marks = [] if name == SAMPLE else [pytest.mark.long]
        yield from (pytest.param(name, change, id=f"{name}: {change}", marks=marks) for change in case.changes)


@pytest.mark.parametrize(("name", "change"), list(changes()))
def test_the_diagnosis_stays_the_same(
    name: str, change: str, original_of: Callable[[str], Original], tmp_path: Path
) -> None:
    original = original_of(name)
    case, before = original.case, original.diagnosis
    assert (before.verdict, effects_of(before)) == (case.verdict, case.effects), before.summary
    after = diagnose_file(case.changes[change](original.file), tmp_path)
    own_frame = not original.file.formulas and original.file.sidecar["reference"]["frame"] == "machine"
    if change == CONSTANT and own_frame and before.verdict == "adequate":
        # of a machine that is measured in its own frame this is what is wrong, and these effects may make it
        assert effects_of(after) <= MAKE_A_CONSTANT
        return
    # there a constant is fitted where it is needed only, and takes a share of what effects do
    standard_errors = 2.0 if change == CONSTANT and own_frame else 1.0
    factor = 1 / URAD_PER_MRAD if change == "the reference in another unit" else 1.0
    assert_same(before, after, standard_errors=standard_errors, factor=factor)
