"""Seeded numbers belong to a cause's id: one cause more in the catalogue changes no other cause's numbers."""

from __future__ import annotations

import numpy as np
import pytest

from compd.configuration import load
from compd.simulation.campaign import simulated_recording
from compd.simulation.campaign.simulated_recording import SimulatedRecording, simulate_recording
from compd.simulation.causes import catalogue, hidden_cause
from compd.simulation.causes.catalogue import CAUSES, build_cause, possible_causes, shuffle_causes
from compd.simulation.causes.hidden_cause import HiddenCause, draw_hidden
from compd.simulation.causes.link import LinkZero
from compd.simulation.truth.mechanism import Mechanism
from tests.scoreboard import cases as scoreboard
from tests.scoreboard import draws as scoreboard_draws
from tests.support.simulated import TRIPOD, hexapod, tripod

MACHINES = (Mechanism(tripod()), Mechanism(hexapod()))
SEEDS = range(200)
# A seed whose weak disturbances do not contain the added cause.
CAMPAIGN_SEED = 3


class AddedCause(LinkZero):
    """A cause that the catalogue does not have."""

    id = "added_cause"


def add_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put the added cause before all others, so that every place in the list changes."""
    causes = {AddedCause.id: AddedCause, **CAUSES}
    for module in (catalogue, hidden_cause, simulated_recording, scoreboard_draws):
        monkeypatch.setattr(module, "CAUSES", causes)
    assert next(iter(possible_causes(MACHINES[0]))) == AddedCause.id


def draws() -> list[HiddenCause]:
    return [draw_hidden(seed, machine) for machine in MACHINES for seed in SEEDS]


def test_a_hidden_cause_changes_only_where_the_added_one_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    before = draws()
    add_cause(monkeypatch)
    after = draws()
    changed = [(old, new) for old, new in zip(before, after, strict=True) if old != new]
    assert 0 < len(changed) < 0.1 * len(before)
    for old, new in changed:
        assert new.id == AddedCause.id
        assert new.floors == old.floors


def test_every_cause_keeps_its_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    before = {name: build_cause(name, 0.1, MACHINES[0], 1) for name in CAUSES}
    add_cause(monkeypatch)
    for name, cause in before.items():
        again = build_cause(name, 0.1, MACHINES[0], 1)
        assert again.values == cause.values
        drawn = {key: value for key, value in vars(cause).items() if key.endswith(("tau_s", "_mm", "_rad", "_s"))}
        for key, value in drawn.items():
            np.testing.assert_array_equal(vars(again)[key], value)


def test_causes_of_the_same_distribution_differ() -> None:
    base, platform = (build_cause(f"{name}_joint_position", 10.0, MACHINES[0], 1) for name in ("base", "platform"))
    assert base.values != platform.values


@pytest.mark.long
def test_a_campaign_stays_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def campaign() -> SimulatedRecording:
        return simulate_recording(load(TRIPOD), CAMPAIGN_SEED, [HiddenCause("joint_runout", 2.0)])

    before = campaign()
    add_cause(monkeypatch)
    after = campaign()
    assert [cause.id for cause in after.weak] == [cause.id for cause in before.weak]
    assert [cause.values for cause in after.weak] == [cause.values for cause in before.weak]
    assert after.hidden[0].cause.values == before.hidden[0].cause.values
    for name, values in before.columns.items():
        np.testing.assert_array_equal(values, after.columns[name], err_msg=name)


def test_weak_disturbances_change_only_by_the_added_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    before = [shuffle_causes(possible_causes(MACHINES[0]), seed, "weak") for seed in SEEDS]
    add_cause(monkeypatch)
    for seed, order in zip(SEEDS, before, strict=True):
        after = shuffle_causes(possible_causes(MACHINES[0]), seed, "weak")
        assert [name for name in after if name != AddedCause.id] == order


def test_pairs_of_the_scoreboard_change_only_by_the_added_cause(monkeypatch: pytest.MonkeyPatch) -> None:
    def pairs() -> list[scoreboard.Case]:
        return scoreboard.cases(["pair"], "full")

    before = pairs()
    add_cause(monkeypatch)
    changed = [(old, new) for old, new in zip(before, pairs(), strict=True) if old != new]
    assert changed
    for old, new in changed:
        assert AddedCause.id in new.causes
        assert new.floors == old.floors
