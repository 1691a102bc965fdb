"""By how much models move the tip: of the last minute, and never of two models at once."""

from __future__ import annotations

import pytest

from compd.page.model_effects import SPAN_S, ModelEffects

BARE = {"applied": {"effects": []}}
WITH_SHADOW = BARE | {"shadow": {"effects": ["link_zero"], "file": "/a.yaml", "model": "1"}}
NOTHING = {"seconds": 0.0, "applied_um": None, "beyond_um": None}


def budget(time_s, effect_um, shadow_um=None):
    moved = {"joints": [1.0, 1.0, 1.0], "frame": [0.5, 0.0, 0.0], "link_zero": effect_um}
    shadow = {} if shadow_um is None else {"shadow_tip_um": shadow_um}
    return {"time_s": time_s, "tip_um": moved, **shadow}


def noted(*budgets, models=WITH_SHADOW):
    effects = ModelEffects()
    effects.note(None, models)
    for newest in budgets:
        effects.note(newest, models)
    return effects


def test_it_is_the_root_mean_square_of_each_axis():
    errors = noted(
        budget(1.0, [0.0, 0.0, 3.0], [1.5, 1.0, 4.0]), budget(2.0, [0.0, 0.0, 4.0], [4.5, 1.0, 5.0])
    ).summary()
    assert errors["seconds"] == 1.0
    assert errors["applied_um"] == pytest.approx([0.0, 0.0, 12.5**0.5], abs=1e-4)
    assert errors["beyond_um"] == pytest.approx([4.5**0.5, 0.0, 0.0], abs=1e-4)


def test_the_same_budget_counts_once_and_an_old_one_no_more():
    newest = budget(1.0, [2.0, 0.0, 0.0])
    effects = noted(newest, newest, newest)
    effects.note(budget(1.1 + SPAN_S, [4.0, 0.0, 0.0]), WITH_SHADOW)
    assert effects.summary()["applied_um"] == [4.0, 0.0, 0.0]


def test_another_model_begins_anew_without_the_budget_that_may_be_of_the_one_before():
    old = budget(1.0, [0.0, 0.0, 0.0], [9.0, 9.0, 9.0])
    effects = noted(old)
    adopted = {"applied": WITH_SHADOW["shadow"], "shadow": WITH_SHADOW["shadow"]}
    effects.note(old, adopted)
    assert effects.summary() == NOTHING
    effects.note(old, adopted)
    assert effects.summary() == NOTHING
    effects.note(budget(2.0, [7.5, 8.0, 8.0], [9.0, 9.0, 9.0]), adopted)
    assert effects.summary()["beyond_um"] == [0.0, 0.0, 0.0]


def test_without_a_shadow_or_a_valid_setpoint_there_is_no_number():
    assert noted(budget(1.0, [1.0, 0.0, 0.0]), models=BARE).summary()["beyond_um"] is None
    assert noted({"valid": False}).summary() == NOTHING
    assert noted(budget(1.0, [1.0, 0.0, 0.0]), models=None).summary() == NOTHING
    effects = noted(budget(1.0, [1.0, 0.0, 0.0]))
    effects.note(None, None)
    assert effects.summary() == NOTHING
