"""The machine as built as a file: it moves as the drawing with the effects does, and keeps its comments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from compd.built_machine import BuiltFiles, Provenance, built_geometry, write_built_machine
from compd.calibration import rows_at
from compd.configuration import Configuration, load, shipped_configuration
from compd.documents import read_document
from compd.errors import ConfigurationError
from compd.machine_builder import build_model
from compd.machine_check import load_whole
from compd.machine_kinds import KINDS, machine_text
from compd.model import MachineModel, effect_deltas, predict, sum_deltas
from compd.model.effects import FittedEffect
from compd.model_file import read_model_file
from tests.unit.built_machine.machines import random_effects

Floats = NDArray[np.float64]

GEOMETRIC = ("link_zero", "base_joint_position", "platform_joint_position", "revolute_axis_tilt", "tool_offset")
PROVENANCE = Provenance("compd calibrate", "2026-11-28", (("poses.csv", "ab" * 32),))
SHIPPED = ("hexapod", "tripod-cmm")


def drawing(tmp_path: Path, kind: str) -> Configuration:
    path = tmp_path / f"{kind}.yaml"
    if kind in SHIPPED:
        path.write_text(shipped_configuration(path.name).read_text(encoding="utf-8"), encoding="utf-8")
    else:
        path.write_text(machine_text("mine", kind, KINDS[kind].usual), encoding="utf-8")
    return load(path)


def model_of(configuration: Configuration) -> MachineModel:
    return build_model(configuration.geometry, configuration.wiring)


def effects_of(configuration: Configuration, ids: tuple[str, ...], seed: int) -> tuple[FittedEffect, ...]:
    return random_effects(model_of(configuration), ids, seed)


def tips_with(configuration: Configuration, effects: tuple[FittedEffect, ...]) -> tuple[Floats, Floats]:
    """Tips and attitudes at 40 random readings of the scales, with effects."""
    model = model_of(configuration)
    rows = rows_at(model, np.random.default_rng(5).uniform(-25, 25, (40, model.scales)))
    predicted = predict(model, rows, sum_deltas([effect_deltas(effect, rows)[0] for effect in effects]))
    assert not predicted.reason.any()
    return predicted.tip_mm, predicted.rotation_M_P


def built(configuration: Configuration, effects: tuple[FittedEffect, ...]) -> BuiltFiles:
    size = sum(len(effect.theta) for effect in effects)
    out = configuration.path.with_name("built.yaml")
    return write_built_machine(configuration, effects, np.eye(size), PROVENANCE, out)


@pytest.mark.parametrize("kind", [*KINDS, *SHIPPED])
def test_it_moves_as_the_drawing_with_the_effects(tmp_path: Path, kind: str) -> None:
    configuration = drawing(tmp_path, kind)
    effects = effects_of(configuration, GEOMETRIC, seed=len(kind))
    files = built(configuration, effects)
    assert files.model is None
    as_built = load_whole(files.machine)
    tip_mm, rotation = tips_with(configuration, effects)
    drawn_mm, _ = tips_with(configuration, ())
    built_mm, built_rotation = tips_with(as_built, ())
    assert np.abs(tip_mm - drawn_mm).max() > 0.2
    # numbers are written to 1 nm and 1 nrad; the tip sees six lengths and joints at once
    assert np.abs(built_mm - tip_mm).max() < 3e-5
    assert np.abs(built_rotation - rotation).max() < 3e-7


@pytest.mark.parametrize("kind", [*KINDS, *SHIPPED])
def test_the_file_has_exactly_the_numbers(tmp_path: Path, kind: str) -> None:
    configuration = drawing(tmp_path, kind)
    effects = effects_of(configuration, GEOMETRIC, seed=3)
    files = built(configuration, effects)
    document = read_document(files.machine)
    numbers = built_geometry(configuration, effects).numbers
    assert numbers
    for location, value in numbers.items():
        assert np.array_equal(np.asarray(document.value(location)), np.asarray(value))


def test_gains_go_into_a_model_file_that_the_machine_names(tmp_path: Path) -> None:
    configuration = drawing(tmp_path, "6-ups")
    effects = effects_of(configuration, ("base_joint_position", "scale_gain"), seed=1)
    files = built(configuration, effects)
    as_built = load_whole(files.machine)
    assert files.model is not None
    assert as_built.state.model_file == str(files.model)
    model = read_model_file(files.model, as_built.machine, as_built.geometry.links, as_built.geometry_hash)
    assert [one.effect.id for one in model.fitted] == ["scale_gain"]
    assert np.array_equal(model.fitted[0].theta, effects[1].theta)
    tip_mm, _ = tips_with(configuration, effects)
    assert np.abs(tips_with(as_built, model.fitted)[0] - tip_mm).max() < 3e-5


def test_comments_stay_and_the_drawings_numbers_stand_beside(tmp_path: Path) -> None:
    configuration = drawing(tmp_path, "hexapod")
    before = configuration.path.read_text(encoding="utf-8").splitlines()
    effects = effects_of(configuration, ("platform_joint_position",), seed=2)
    after = built(configuration, effects).machine.read_text(encoding="utf-8").splitlines()
    assert any(line.startswith("# Recording: poses.csv, sha256 abab") for line in after)
    assert "    joints_P_mm:                       # universal joints: no revolute axes" in after
    changed = [line for line in after if "# drawing: joints_P_mm [89.1773790573, 80.2956727631, 0]" in line]
    assert len(changed) == 1
    attitude = next(line for line in after if "zero_rotation_P_in_M_rad" in line and not line.startswith("#"))
    assert "say what it is at machine zero; drawing: zero_rotation_P_in_M_rad [0, 0, 0]" in attitude
    # every other line is as it was
    assert len([line for line in before if line not in after]) == 6 + 2


def test_a_second_calibration_keeps_the_drawings_numbers(tmp_path: Path) -> None:
    configuration = drawing(tmp_path, "rotary-delta")
    first = built(configuration, effects_of(configuration, ("link_zero",), seed=2)).machine
    again = first.with_name("again.yaml")
    as_built = load(first)
    effects = effects_of(as_built, ("link_zero",), seed=4)
    write_built_machine(as_built, effects, np.eye(6), PROVENANCE, again)
    lines = [line for line in again.read_text(encoding="utf-8").splitlines() if "length_mm:" in line]
    drawn = [line for line in configuration.path.read_text(encoding="utf-8").splitlines() if "length_mm:" in line]
    for line, old in zip(lines, drawn, strict=True):
        assert line.count("drawing:") == 1
        assert line.endswith(f"drawing: length_mm {old.split('length_mm: ')[1].rstrip('}')}")


def test_the_drawing_is_never_replaced(tmp_path: Path) -> None:
    configuration = drawing(tmp_path, "6-ups")
    effects = effects_of(configuration, ("link_zero",), seed=2)
    with pytest.raises(ConfigurationError, match="is the file of the drawing"):
        write_built_machine(configuration, effects, np.eye(6), PROVENANCE, configuration.path)
