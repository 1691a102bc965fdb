"""Files of effects that come with compd, for telescopes, stages, axes and plates: their physics, and real machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import compd
from compd.model.effects import Effect, evaluate_basis
from tests.support.external_recordings import external_rows
from tests.support.model_machines import Floats
from tests.support.paths import SHARED

REAL = SHARED / "real"
FILES = ("axis", "plate", "stage", "telescope")
ARCSEC = np.deg2rad(1 / 3600)
# Right-handed: x east, y north, z up.
EAST, NORTH, UP = np.eye(3)


def moved_um(
    library: str, id_: str, constants: Mapping[str, float] | None = None, tip_mm: Any = (0.0, 0.0, 0.0), **values: Any
) -> Floats:
    """(N, 2, P): what a unit of each of an effect's P numbers adds to x and y, um, where `values` were measured."""
    quantities = {name: np.atleast_1d(np.asarray(value, dtype=float)) for name, value in values.items()}
    time_s = quantities.pop("time_s", None)
    count = max([len(np.atleast_2d(tip_mm)), *map(len, quantities.values())])
    time_s = np.arange(count, dtype=float) if time_s is None else time_s
    tip_M_mm = np.broadcast_to(np.asarray(tip_mm, dtype=float), (count, 3))
    rows = external_rows(tip_M_mm, quantities, time_s=time_s)
    basis, _ = evaluate_basis(compd.load_effects(library)[id_], rows, constants or {}, None)
    assert not basis[:, 2:].any()
    return np.asarray(basis[:, :2] * 1e3)


@pytest.mark.parametrize("library", FILES)
def test_every_effect_says_what_a_person_must_know(library: str) -> None:
    effects = compd.load_effects(library)
    for id_, effect in effects.items():
        assert effect.mistaken_for, id_
        assert set(effect.mistaken_for) <= set(effects) - {id_}
        assert not effect.separated_by.startswith("rows in which the formula's columns"), "the default says nothing"
        assert all(parameter.source for parameter in (*effect.parameters, *effect.constants))


def test_no_id_stands_in_two_files() -> None:
    ids = [id_ for library in FILES for id_ in compd.load_effects(library)]
    assert len(ids) == len(set(ids)), "several files can be given together"


# --- telescope -----------------------------------------------------------------------------------------------------


def turn(axis: Floats, arcsec: float) -> Rotation:
    return Rotation.from_rotvec(axis * arcsec * ARCSEC)


def points_at(azimuth_deg: float, elevation_deg: float, **askew: float) -> tuple[float, float]:
    """Azimuth and elevation, rad, of the line of sight when the encoders show these; askew : terms in arcsec.

    The mount is built up from its axes: base, azimuth axis, elevation axis, line of sight.
    """
    term = {"IA": 0.0, "IE": 0.0, "CA": 0.0, "NPAE": 0.0, "AN": 0.0, "AW": 0.0, **askew}
    azimuth_rad = np.deg2rad(azimuth_deg) - term["IA"] * ARCSEC
    elevation_rad = np.deg2rad(elevation_deg) + term["IE"] * ARCSEC
    pole = turn(EAST, -term["AN"]) * turn(NORTH, -term["AW"])  # leans to the north, to the west
    east, north, up = (
        pole
        * Rotation.from_rotvec(-UP * azimuth_rad)
        * turn(NORTH, -term["NPAE"])
        * Rotation.from_rotvec(EAST * elevation_rad)
        * turn(UP, term["CA"])
    ).apply(NORTH)
    return float(np.arctan2(east, north)), float(np.arcsin(up))


@pytest.mark.parametrize("term", ["IA", "IE", "CA", "NPAE", "AN", "AW"])
@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), [(20.0, 35.0), (115.0, 60.0), (230.0, 15.0), (310.0, 75.0)])
def test_a_geometrical_term_is_what_the_askew_mount_does(term: str, azimuth_deg: float, elevation_deg: float) -> None:
    azimuth_rad, elevation_rad = points_at(azimuth_deg, elevation_deg, **{term: 1.0})
    d_azimuth = (azimuth_rad - np.deg2rad(azimuth_deg) + np.pi) % (2 * np.pi) - np.pi
    expected = np.array([d_azimuth * np.cos(elevation_rad), elevation_rad - np.deg2rad(elevation_deg)]) / ARCSEC
    found = moved_um("telescope", term.lower(), azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    np.testing.assert_allclose(found[0, :, 0], expected, atol=1e-4)


def test_a_tube_droops_by_its_weight_across_it() -> None:
    elevation_deg = np.array([30.0, 45.0, 60.0, 89.0])
    across = np.sin(np.deg2rad(90.0 - elevation_deg))
    beam = moved_um("telescope", "tf", elevation_deg=elevation_deg)[:, :, 0]
    np.testing.assert_allclose(beam, np.stack([np.zeros(4), -across], axis=1), atol=1e-12)
    shift = moved_um("telescope", "tx", elevation_deg=elevation_deg)[:, :, 0]
    np.testing.assert_allclose(shift[:, 1], -1 / np.tan(np.deg2rad(elevation_deg)), rtol=1e-12)
    assert not shift[:, 0].any()


# --- stage and axis --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("library", ["stage", "axis"])
def test_reversal_is_the_way_up_less_the_way_down(library: str) -> None:
    """ISO 230-2: B is the deviation approached upwards less that approached downwards."""
    up, down = moved_um(library, f"{library}_backlash", approach_1=[1.0, -1.0])[:, 0, 0]
    assert up - down == pytest.approx(1.0)
    assert up + down == pytest.approx(0.0)


@pytest.mark.parametrize("library", ["stage", "axis"])
def test_a_wrong_lead_and_a_screw_that_winds_up_grow_with_the_travel(library: str) -> None:
    gain = moved_um(library, f"{library}_gain", tip_mm=[[0.0, 0, 0], [500.0, 0, 0]])[:, 0, 0]
    assert gain == pytest.approx([0.0, 0.5]), "half a metre at 1 um/m"
    places = [[0.0, 0, 0], [500.0, 0, 0], [500.0, 0, 0]]
    windup = moved_um(library, f"{library}_windup", tip_mm=places, approach_1=[1.0, 1.0, -1.0])[:, 0, 0]
    assert windup == pytest.approx([0.0, 0.5, -0.5])


def test_a_bow_of_25_um_in_the_middle_of_100_mm() -> None:
    bow = 0.01 * moved_um("stage", "stage_bow", tip_mm=[[-50.0, 0, 0], [0.0, 0, 0], [50.0, 0, 0]])[:, 0, 0]
    assert bow.mean(where=[True, False, True]) - bow[1] == pytest.approx(25.0)


@pytest.mark.parametrize("library", ["stage", "axis"])
def test_a_cyclic_error_repeats_after_a_turn(library: str) -> None:
    """A screw of 2 mm lead: after a quarter turn from zero, and from there after a half and after a whole turn."""
    places = [[x, 0.0, 0.0] for x in (0.5, 1.5, 2.5)]
    sine, cosine = moved_um(library, f"{library}_cyclic", {"p": 2.0}, tip_mm=places)[:, 0].T
    assert sine == pytest.approx([1.0, -1.0, 1.0], abs=1e-9)
    assert cosine == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_a_reading_20_ms_old_is_behind_a_moving_axis() -> None:
    """At 30 mm/s the axis has moved on by 0.6 mm."""
    behind = moved_um("axis", "axis_latency", velocity_1_mm_per_s=[30.0, -30.0])[:, 0, 0]
    assert 20.0 * behind == pytest.approx([600.0, -600.0])


def test_a_steel_screw_grows_from_where_it_is_held() -> None:
    """500 mm of steel, 4 K warm: 23 um; its mount moves all places alike."""
    places = [[0.0, 0, 0], [500.0, 0, 0]]
    grown = 11.5 * moved_um("axis", "axis_expansion", tip_mm=places, temperature_axis_degC=[24.0, 24.0])[:, 0, 0]
    assert grown == pytest.approx([0.0, 23.0])
    mount = moved_um("axis", "axis_mount_expansion", tip_mm=places, temperature_axis_degC=[24.0, 24.0])[:, 0, 0]
    assert mount == pytest.approx([4.0, 4.0])


def test_a_part_that_follows_its_thermometer_late_has_63_percent_after_tau() -> None:
    time_s = np.linspace(0.0, 600.0, 601)
    late = moved_um(
        "axis",
        "axis_expansion_lag",
        {"tau": 600.0},
        tip_mm=[1000.0, 0.0, 0.0],
        temperature_axis_degC=np.where(time_s > 0, 25.0, 20.0),
        time_s=time_s,
    )[:, 0, 0]
    assert late[0] == 0.0
    assert late[-1] == pytest.approx(5.0 * (1 - np.exp(-1)), rel=2e-3)


# --- plate -----------------------------------------------------------------------------------------------------------


def test_a_plate_turned_grown_and_drilled_askew() -> None:
    """Holes of a drill whose axes are not true, on a plate that grew and lies turned: each step by itself, exactly."""
    holes_mm = np.array([[120.0, 40.0], [-90.0, 200.0], [10.0, -150.0]])
    scale, unequal, shear_rad, turned_rad = 50e-6, 20e-6, 30e-6, 1e-4
    drilled = holes_mm * [1 + unequal, 1 - unequal]
    # each axis leans towards the other by half of what lacks to a right angle
    drilled = drilled + shear_rad * holes_mm[:, ::-1]
    c, s = np.cos(turned_rad), np.sin(turned_rad)
    measured_mm = (1 + scale) * drilled @ np.array([[c, s], [-s, c]]) + [0.3, -0.2]
    numbers = {
        "plate_offset": [300.0, -200.0],
        "plate_rotation": [turned_rad * 1e3],
        "plate_scale": [scale * 1e6],
        "plate_quadrupole": [unequal * 1e6, shear_rad * 1e6],
    }
    tip_mm = np.column_stack([holes_mm, np.zeros(3)])
    added = sum(moved_um("plate", id_, tip_mm=tip_mm) @ np.array(values) for id_, values in numbers.items())
    np.testing.assert_allclose(added, (measured_mm - holes_mm) * 1e3, atol=5e-3)


# --- real machines ---------------------------------------------------------------------------------------------------


def fit_um(name: str, library: str, ids: list[str], **renamed: str) -> tuple[dict[str, float], Floats]:
    """Plain least squares on a real recording: the numbers by name, and the residual (N, m), um.

    renamed : columns that the recording has under another name.
    """
    path = REAL / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"no real recordings: {path} is not there")
    aligned = compd.open_recording(path)
    quantities = {renamed.get(column, column): values for column, values in aligned.rows.quantities.items()}
    aligned = replace(aligned, rows=replace(aligned.rows, quantities=quantities))
    effects: list[Effect] = [compd.load_effects(library)[id_] for id_ in ids]
    residual_um = (aligned.measured_mm - aligned.predicted_mm({})) * 1e3
    columns_um = np.concatenate([aligned.columns(effect, {}) * 1e3 for effect in effects], axis=2)
    flat = columns_um.reshape(-1, columns_um.shape[2])
    numbers = np.linalg.lstsq(flat, residual_um.ravel(), rcond=None)[0]
    names = [parameter.name for effect in effects for parameter in effect.parameters]
    return dict(zip(names, numbers, strict=True)), residual_um - columns_um @ numbers


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_a_telescopes_terms_are_those_that_tpoint_found() -> None:
    """The recording has encoders minus star, the opposite of TPOINT's corrections."""
    numbers, left_um = fit_um("telescope-pointing-2022", "telescope", ["ia", "ie", "ca", "an", "aw", "tx"])
    tpoint = {"IA": -292.0, "IE": -213.0, "CA": 90.9, "AN": 39.2, "AW": 70.9, "TX": -6.86}
    assert numbers == pytest.approx({name: -value for name, value in tpoint.items()}, abs=0.1)
    assert rms(left_um) == pytest.approx(2.2, abs=0.05)


def test_a_drilled_plate_is_explained_by_all_four() -> None:
    ids = ["plate_offset", "plate_rotation", "plate_scale", "plate_quadrupole"]
    _, nothing_um = fit_um("plug-plate-1597A-2011", "plate", ["plate_offset"])
    numbers, left_um = fit_um("plug-plate-1597A-2011", "plate", ids)
    assert rms(nothing_um) > 10.0
    assert rms(left_um) < 4.1
    assert abs(numbers["q"]) > 10 * abs(numbers["p"])


def test_a_stage_is_explained_by_zero_play_and_lead() -> None:
    ids = ["stage_offset", "stage_backlash", "stage_gain"]
    numbers, left_um = fit_um("slit-stage-11358-1", "stage", ids, moved_1="approach_1")
    assert 0.1 < abs(numbers["B"]) < 2.6
    assert rms(left_um) < 0.13
