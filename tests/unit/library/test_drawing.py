"""Effects of a drawing beside machines that `compd.simulation` builds with a number of their configuration changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import compd
from compd.arrays import FloatArray
from compd.configuration import load
from compd.model import effect_deltas, predict
from compd.model.effects import FittedEffect
from compd.model.library import DRAWN, find_effect, load_library
from compd.simulation import Mechanism
from tests.support.built_machines import built, drawing, poses, record, targets

# Of the drawing, by its effect: the kind of machine, and how large the number is in the effect's unit.
CASES = {
    "actuator_zero": ("linear-delta", 100.0),
    "scale_gain_change": ("6-ups", 5.0),
    "actuator_direction": ("linear-delta", 1000.0),
    "crank_radius": ("rotary-delta", 100.0),
    "hinge_inclination": ("3-rps", 1000.0),
}
# What is left of second order: 0.1 mm over 100 mm, squared.
SECOND_ORDER_MM = 5e-4


def geometry_with(geometry: dict[str, Any], name: str, size: float) -> None:
    """Change the first actuator or hinge of a configuration's `geometry` as the effect's first number does."""
    first = geometry["actuators"][0]
    if name == "actuator_direction":
        first["along_B"] = (np.array(first["along_B"]) + 1e-6 * size * np.array([1.0, 0.0, 0.0])).tolist()
    elif name == "crank_radius":
        first["radius_mm"] += 1e-3 * size
    elif name == "hinge_inclination":
        hinge = geometry["hinges"][0]
        hinge["axis_B"] = (np.array(hinge["axis_B"]) + 1e-6 * size * np.array([0.0, 0.0, 1.0])).tolist()


@pytest.mark.parametrize("name", CASES)
def test_a_changed_drawing_moves_the_tip_as_the_effect_says(name: str, tmp_path: Path) -> None:
    kind, size = CASES[name]
    rng = np.random.default_rng(4)
    path = drawing(kind, tmp_path)
    data = yaml.safe_load(path.read_text(encoding="utf-8").replace("{on: platform", '{"on": platform'))
    geometry_with(data["geometry"], name, size)
    other = path.with_name("other.yaml")
    other.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    drawn, changed = (Mechanism(load(one).geometry) for one in (path, other))
    world = built(path, rng, 0.0)._replace(built=changed, moved_mm=zeros_between(drawn, changed))
    if name == "actuator_zero":
        world.zero_mm[0] += 1e-3 * size
    if name == "scale_gain_change":
        world.bend[0] += 1e-6 * size
    wanted = [target for target, _ in zip(targets(world, rng), range(12), strict=False)]
    recording = compd.open_recording(record(tmp_path / "rows.csv", world, rng, 12, wanted, noise=0.0))
    effect = find_effect(name, "test")
    theta = np.zeros(len(effect.columns(recording.rows.links)))
    theta[0] = size
    added, _ = effect_deltas(FittedEffect(effect, theta), recording.rows)
    assert recording.model is not None
    tip_mm = predict(recording.model, recording.rows, added).tip_mm
    without_mm = predict(recording.model, recording.rows, {}).tip_mm
    true_mm = np.array([tip for _, tip, _ in poses(world, wanted)])
    assert np.abs(tip_mm - true_mm).max() < SECOND_ORDER_MM
    assert np.abs(without_mm - true_mm).max() > 10 * SECOND_ORDER_MM


def zeros_between(drawn: Mechanism, changed: Mechanism) -> FloatArray:
    """(m,) from the drawn place of each actuator at machine zero to that with the tip at machine zero."""
    extended = drawn.extended[drawn.link_of_scale]
    lengths_mm = (drawn.lengths0_mm - changed.lengths0_mm)[drawn.link_of_scale]
    return np.where(extended, lengths_mm, drawn._zero_mm - changed._zero_mm)


def test_a_diagnosis_does_not_try_them_and_a_model_file_may_name_them() -> None:
    ids = {effect.id for effect in DRAWN}
    assert ids == set(CASES)
    assert not ids & set(load_library())
    for effect in DRAWN:
        assert find_effect(effect.id, "test") is effect
        assert set(effect.mistaken_for) <= ids | set(load_library())
        for text in (effect.physics, effect.equation, effect.source, effect.separated_by):
            assert len(text) > 5
        for number in effect.parameters:
            assert number.name in " ".join(effect.symbols)
