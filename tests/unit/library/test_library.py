"""The library as a whole: every effect is documented, and one definition serves a single row and many."""

from __future__ import annotations

import pkgutil
import textwrap
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import compd.model.library
from compd.errors import CompdError, PluginError
from compd.model import deltas_by_effect
from compd.model.deltas import port_size
from compd.model.effects import PORTS, Effect, FittedEffect, can_concern, evaluate_basis, needed_quantities, unmet_needs
from compd.model.kinematics import update_motion
from compd.model.library import BUNDLED, find_effect, load_library
from tests.support.effect_rows import (
    HEXAPOD,
    LIBRARY,
    TRIPOD,
    constants_of,
    observe_rows,
    random_inputs,
    row_at_zero,
    select_rows,
)
from tests.support.external_recordings import external_rows
from tests.support.model_machines import Floats

PORT_FILES = {
    module.name: import_module(f"compd.model.library.{module.name}").EFFECTS
    for module in pkgutil.iter_modules(compd.model.library.__path__)
    if module.name in PORTS
}


def test_the_library_is_what_stands_in_its_files() -> None:
    """Nothing but an entry in the file of its port makes an effect part of the library."""
    assert {effect.id for effect in BUNDLED} == {effect.id for effects in PORT_FILES.values() for effect in effects}
    assert len({effect.id for effect in BUNDLED}) == len(BUNDLED)


@pytest.mark.parametrize("name", PORT_FILES)
def test_effects_stand_in_the_file_of_their_first_port(name: str) -> None:
    # a revolute axis belongs to a platform joint
    ports = {name, "revolute_axis"} if name == "platform_joint" else {name}
    assert {effect.ports[0] for effect in PORT_FILES[name]} <= ports


@pytest.mark.parametrize("effect", BUNDLED, ids=lambda effect: effect.id)
def test_every_effect_says_what_it_must(effect: Effect) -> None:
    for text in (effect.physics, effect.equation, effect.source, effect.separated_by):
        assert len(text) > 5
    assert effect.physics.endswith(".")
    assert effect.symbols
    assert effect.parameters
    assert set(effect.ports) <= set(PORTS)
    assert set(effect.mistaken_for) <= set(LIBRARY) - {effect.id}
    for number in (*effect.parameters, *effect.constants):
        assert number.low < number.high
        assert number.unit
        assert len(number.source) > 5
        assert number.name in " ".join(effect.symbols), f"{number.name} is not explained"
    for constant in effect.constants:
        assert all(constant.low <= value <= constant.high for value in constant.grid)
    assert effect.remembers == ("order" in effect.needs)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
@pytest.mark.parametrize("effect", BUNDLED, ids=lambda effect: effect.id)
def test_rows_at_once_are_row_after_row_bit_for_bit(effect: Effect, model: object) -> None:
    assert model in (TRIPOD, HEXAPOD)
    machine = TRIPOD if model is TRIPOD else HEXAPOD
    arguments = random_inputs(machine)
    rows = observe_rows(machine, arguments)
    if unmet_needs(effect, rows.available, rows.links):
        assert "revolute_axes" in effect.needs
        return
    theta = np.linspace(0.3, 1.7, len(effect.columns(rows.links)))
    fitted = [FittedEffect(effect, theta, constants_of(effect))]
    at_once, last = deltas_by_effect(fitted, rows, {})
    one_by_one = []
    memories = {}
    for i in range(len(rows)):
        found, memories = deltas_by_effect(
            fitted, observe_rows(machine, select_rows(arguments, slice(i, i + 1))), memories
        )
        one_by_one.append(found[effect.id])
    for port, values in at_once[effect.id].items():
        assert values.shape == (len(rows), port_size(port, rows))
        np.testing.assert_array_equal(values, np.concatenate([one[port] for one in one_by_one]))
        assert np.isfinite(values).all()
    assert any(np.any(values != 0) for values in at_once[effect.id].values())
    assert (last[effect.id] is not None) == effect.remembers
    if effect.remembers:
        for whole, row_by_row in zip(last[effect.id] or (), memories[effect.id] or (), strict=True):
            np.testing.assert_array_equal(whole, row_by_row)


def test_a_missing_gauge_is_named() -> None:
    available = row_at_zero().available - {"temperature_link_2_degC"}
    (problem,) = unmet_needs(LIBRARY["link_expansion"], available, 3)
    assert "temperature_link_2_degC" in problem.what
    assert "wire a thermometer under `wiring: quantities:`" in problem.next_step
    (problem,) = unmet_needs(LIBRARY["tool_bending"], available - {"force_y_N"}, 3)
    assert "a force gauge" in problem.next_step
    (problem,) = unmet_needs(LIBRARY["plate_bending"], available - {"plate_thickness_mm"}, 3)
    assert "plate_thickness_mm" in problem.next_step
    assert not unmet_needs(LIBRARY["link_expansion"], row_at_zero().available, 3)


def test_every_effect_reads_no_more_than_it_declares() -> None:
    """A basis that reads a quantity which is not in `needs` fails here: only what is declared is there."""
    for effect in BUNDLED:
        arguments = random_inputs(TRIPOD, 2)
        declared = set(needed_quantities(effect, 3))
        arguments["quantities"] = {k: v for k, v in arguments["quantities"].items() if k in declared}
        evaluate_basis(effect, observe_rows(TRIPOD, arguments), constants_of(effect), None)


def test_a_hexapod_has_no_revolute_axes() -> None:
    effects = [effect for effect in BUNDLED if "revolute_axes" in effect.needs]
    assert effects
    for effect in effects:
        (problem,) = unmet_needs(effect, row_at_zero(HEXAPOD).available, 6)
        assert "tripod" in problem.next_step


def test_no_effect_sees_the_reference() -> None:
    arguments = random_inputs(TRIPOD, 2)
    arguments["quantities"]["reference_x_mm"] = np.zeros(2)
    with pytest.raises(CompdError, match="must never see the answer"):
        observe_rows(TRIPOD, arguments)


def test_of_links_of_an_external_model_the_scales_can_err() -> None:
    nowhere = np.full((2, 3), np.nan)
    everything = {"scale", "direction", "motion", "time", "order"}
    warm = {"temperature_link_1_degC": np.full(2, 21.0), "temperature_link_2_degC": np.full(2, 22.0)}
    rows = external_rows(nowhere, warm, links=2, recorded=everything)
    usable = {effect.id for effect in BUNDLED if not unmet_needs(effect, rows.available, rows.links)}
    assert usable == {effect.id for effect in BUNDLED if "scale" in effect.ports} | {"link_zero"}
    for effect_id in usable:
        basis, _ = evaluate_basis(LIBRARY[effect_id], rows, constants_of(LIBRARY[effect_id]), None)
        assert np.isfinite(basis).all()
    assert {effect.id for effect in BUNDLED if can_concern(effect, rows.available, rows.links)} == usable
    bare = external_rows(nowhere, {}, links=2, recorded=())
    said = {effect_id: str(unmet_needs(LIBRARY[effect_id], bare.available, 2)) for effect_id in usable}
    assert "scale_1_mm" in said["scale_gain"]
    assert "approach_1" in said["backlash"]
    assert "velocity_1_mm_per_s" in said["gauge_latency"]
    assert "the time of each row" in said["gauge_latency"]
    assert "temperature_link_2_degC" in said["scale_expansion"]


def test_of_an_external_model_only_the_reference_can_err() -> None:
    tip = np.array([[10.0, 20.0, 30.0], [0.0, 0.0, 0.0]])
    air = {"pressure_hPa": np.full(2, 1003.25), "temperature_room_degC": np.full(2, 21.0)}
    rows = external_rows(tip, air)
    usable = [effect for effect in BUNDLED if not unmet_needs(effect, rows.available, rows.links)]
    assert {effect.ports for effect in usable} == {("reference",)}
    assert LIBRARY["plate_bending"] not in usable, "the temperatures of the plate are not measured"
    concerning = {effect.id for effect in BUNDLED if can_concern(effect, rows.available, rows.links)}
    assert concerning == {"reference_drift", "reference_air_index", "reference_registration"}
    basis, _ = evaluate_basis(LIBRARY["reference_air_index"], rows, {}, None)
    np.testing.assert_allclose(basis[0, :3, 0], tip[0] * (-0.93e-6 - 2.7e-6), rtol=1e-12)


def test_links_remember_their_direction_through_noise() -> None:
    motion = None
    path_mm = [0.0, 0.5, 1.0, 0.9995, 1.0004, 0.9996, 0.99, 0.9904, 0.98, 0.9815]
    seen = []
    for i, position in enumerate(path_mm):
        motion = update_motion(motion, 0.001 * i, np.array([position]), np.zeros(1))
        seen.append(float(motion.direction[0]))
    assert seen == [0, 1, 1, 1, 1, 1, -1, -1, -1, 1]


def test_a_link_that_comes_back_in_tiny_steps_has_turned_round() -> None:
    motion = None
    seen = []
    for i, position in enumerate([0.0, 5.0, 4.9997, 4.9994, 4.9991, 4.9988]):
        motion = update_motion(motion, 0.001 * i, np.array([position]), np.zeros(1))
        seen.append(float(motion.direction[0]))
    assert seen == [0, 1, 1, 1, 1, -1]


def test_velocity_settles_at_the_links_speed() -> None:
    motion = None
    for i in range(400):
        motion = update_motion(motion, 0.001 * i, np.array([30.0 * 0.001 * i]), np.array([-1e-6 * i]))
    assert motion is not None
    np.testing.assert_allclose(motion.velocity_mm_per_s, 30.0, rtol=1e-6)
    np.testing.assert_allclose(motion.joint_velocity_mm_per_s, -1e-3, rtol=1e-6)


@pytest.fixture
def own_file(tmp_path: Path) -> Path:
    file = tmp_path / "my_effect.py"
    file.write_text(
        textwrap.dedent("""\
        from dataclasses import replace
        from compd.model.library.link import EFFECTS
        MINE = replace(EFFECTS[0], id="mine")
        NOT_ONE = 3
        """)
    )
    file.chmod(0o644)
    return file


def test_an_effect_from_a_file(own_file: Path) -> None:
    assert find_effect(f"{own_file}:MINE", "model.yaml:3").id == "mine"
    with pytest.raises(PluginError, match="is not an effect"):
        find_effect(f"{own_file}:NOT_ONE", "model.yaml:3")
    own_file.chmod(0o666)
    with pytest.raises(PluginError, match="written by group or others"):
        find_effect(f"{own_file}:MINE", "model.yaml:3")


def test_an_unknown_id_lists_what_there_is() -> None:
    with pytest.raises(PluginError, match="link_expansion_lag"):
        find_effect("link_expansoin", "model.yaml:3")


def test_effects_of_an_installed_package(own_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = tmp_path / "my_effects-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-effects\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[compd.effects]\nmine = my_effect:MINE\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert set(load_library()) == set(LIBRARY) | {"mine"}
    own_file.write_text(own_file.read_text().replace('id="mine"', 'id="link_zero"'))
    monkeypatch.delitem(__import__("sys").modules, "my_effect")
    with pytest.raises(PluginError, match="this id is taken"):
        load_library()


def test_a_stiffness_is_fitted_as_a_compliance() -> None:
    (k,) = LIBRARY["link_elasticity"].parameters
    value, std = k.from_theta(1 / 28.0, 0.001)
    assert value == pytest.approx(28.0)
    assert std == pytest.approx(0.001 * 28.0**2)
    assert k.theta_range == (1 / 200, 1 / 5)
    assert k.from_theta(k.to_theta(17.0))[0] == pytest.approx(17.0)


def as_matrix(values: Floats) -> Floats:
    """(1, size, P) -> (size, P)."""
    return values[0]


def test_columns_are_named_in_the_order_of_the_basis() -> None:
    names = [column.name for column in LIBRARY["base_joint_position"].columns(3)]
    basis, _ = evaluate_basis(LIBRARY["base_joint_position"], row_at_zero(), {}, None)
    assert names[4] == "d_2y"
    assert np.flatnonzero(as_matrix(basis)[:, 4]).tolist() == [4]
    names = [column.name for column in LIBRARY["scale_cyclic"].columns(3)]
    assert names[:4] == ["A1_1", "A1_2", "A1_3", "B1_1"]
