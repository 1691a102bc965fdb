"""What must hold, as functions of single setpoints and of a course of them; the counts of a run."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from compd.configuration import load
from compd.setpoint_states import State
from tests.support.paths import CONFIG
from tests.worlds.coverage import NO_FAULT, Case, Coverage, upper_limit
from tests.worlds.invariants import mostly_valid, nothing_lost, steady_correction, true_reason, within_bound
from tests.worlds.plan import Event
from tests.worlds.rates import kinds
from tests.worlds.recovery import CAUSES, Allowed, Recovery, allowed
from tests.worlds.sight import Happening, Sight
from tests.worlds.world import Told

CONFIGURATION = SimpleNamespace(
    loop=SimpleNamespace(rate_hz=200.0),
    limits=SimpleNamespace(slew_mm_per_s=0.5),
    gauges={"scale_1": None, "scale_2": None},
)


def setpoint(time_s: float, correction_mm: float = 0.0, **more: Any) -> Any:
    return SimpleNamespace(time_s=time_s, values=SimpleNamespace(correction_mm=np.array([correction_mm])), **more)


def sight(now: Any, state: State = State.OK, error_um: float = 0.0, u_tip_um: float = 1.0, **more: Any) -> Sight:
    told = Told(now.time_s, state.valid, state, more.pop("reason", ""), u_tip_um, error_um, more.pop("moving", False))
    given = {"before": None, "recent": (), "suspects": frozenset(), "left_um": error_um} | more
    return Sight(CONFIGURATION, now, told, **given)  # type: ignore[arg-type]


def happening(
    kind: str, ended_s: float = math.inf, is_fault: bool = True, targets: tuple[str, ...] | None = None
) -> Any:
    family, _, name = kind.partition(".")
    fault = SimpleNamespace(began_s=0.0, ended_s=ended_s, present=ended_s == math.inf, targets=targets)
    return Happening(Event(0.0, family, name, "", {}), fault, is_fault)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("error_um", "u_tip_um", "protect_um", "holds"),
    [
        (3.0, 1.0, None, True),
        (3.1, 1.0, None, False),
        (3.1, 1.0, 2.0, True),
        (6.1, 1.0, 2.0, False),
        (3.1, 1.0, math.nan, False),
        (9e9, math.nan, None, True),
    ],
)
def test_a_setpoint_is_within_three_times_its_bound(
    error_um: float, u_tip_um: float, protect_um: float | None, holds: bool
) -> None:
    now = setpoint(1.0, **({} if protect_um is None else {"protect_tip_um": protect_um}))
    assert (within_bound(sight(now, error_um=error_um, u_tip_um=u_tip_um)) == "") is holds
    assert within_bound(sight(now, State.REFUSED, error_um=error_um, u_tip_um=u_tip_um)) == ""


def test_what_no_data_can_show_is_left_out_of_the_error() -> None:
    assert within_bound(sight(setpoint(1.0), error_um=50.0, left_um=2.9)) == ""
    assert "50 um, 3.1 um of it could be known" in within_bound(sight(setpoint(1.0), error_um=50.0, left_um=3.1))


def test_a_departure_has_its_own_case_with_all_of_its_error() -> None:
    departed = sight(setpoint(1.0), error_um=50.0, left_um=0.5, moving=True, departed=True)
    assert departed.cases == {Case("departure", NO_FAULT)}
    assert departed.counted_um == 50.0
    fault = sight(setpoint(1.0), error_um=50.0, left_um=0.5, recent=(happening("lines.cable"),))
    assert fault.cases == {Case("after", "lines")}
    assert fault.counted_um == 0.5


@pytest.mark.parametrize(("by_mm", "holds"), [(0.0025, True), (0.0026, False), (-0.0026, False)])
def test_a_correction_changes_as_slowly_as_its_limit(by_mm: float, holds: bool) -> None:
    found = steady_correction(sight(setpoint(1.005, by_mm), before=setpoint(1.0)))
    assert (found == "") is holds, found


def test_a_reason_names_a_gauge_that_had_a_fault() -> None:
    reason = "waits for a person: look at scale_1, then `compd accept scale_1`"
    now = setpoint(1.0)
    assert true_reason(sight(now, State.FAULT, reason=reason, suspects=frozenset({"scale_1"}))) == ""
    assert true_reason(sight(now, State.FAULT, reason=reason, suspects=frozenset({""}))) == ""
    assert "scale_1" in true_reason(sight(now, State.FAULT, reason=reason, suspects=frozenset({"scale_2"})))
    assert true_reason(sight(now, State.STOP, reason=reason)) == ""


def test_setpoints_are_counted_by_what_is_and_was_wrong() -> None:
    both = (happening("lines.cable"), happening("replies.lost", ended_s=0.5), happening("machine.driven", 0.9, False))
    assert sight(setpoint(1.0), recent=both).cases == {Case("after", "lines"), Case("after", "replies")}
    assert sight(setpoint(1.0), recent=both[2:]).cases == {Case("rest", NO_FAULT)}
    assert sight(setpoint(1.0), moving=True).cases == {Case("motion", NO_FAULT)}
    assert not happening("replies.lost", ended_s=0.5).concerns(5.5)


def test_the_upper_limit_is_that_of_clopper_and_pearson() -> None:
    limit = upper_limit(3, 100, 100)
    assert binom.cdf(3, 100, limit) == pytest.approx(0.05)
    assert upper_limit(0, 100, 100) == pytest.approx(1 - 0.05 ** (1 / 100))
    assert upper_limit(0, 0, 0) == upper_limit(4, 4, 4) == 1.0
    assert upper_limit(30, 1000, 100) == limit


def test_coverage_counts_and_adds_up() -> None:
    rest, after = Case("rest", NO_FAULT), Case("after", "lines")
    one, other = Coverage(), Coverage()
    for error_um, bound_um in ((0.5, 1.0), (2.0, 1.0), (0.5, math.nan)):
        one.count({rest}, True, error_um, bound_um)
    one.count({after}, False, math.nan, math.nan)
    one.count({rest}, True, 0.5, 100.0)
    other.count({after}, True, 0.5, 1.0)
    one.add(other)
    assert (one.all[rest], one.valid[rest], one.bounded[rest], one.beyond[rest]) == (4, 4, 3, 1)
    assert (one.all[after], one.valid[after], one.stretches[after], one.stretches[rest]) == (2, 1, 2, 2)
    assert one.width_um(0.5) == pytest.approx(1.0, rel=0.06)
    assert one.width_um(1.0) == pytest.approx(100.0, rel=0.06)


def test_a_zero_that_was_taken_is_kept() -> None:
    taken = {"scale_1.position": 1.0, "scale_2.position": 2.0}
    assert not nothing_lost(taken, dict(taken))
    assert "1 channels" in nothing_lost(taken, taken | {"scale_2.position": 0.0})
    assert "2 channels" in nothing_lost(taken, {})


def test_without_a_fault_nearly_all_is_valid() -> None:
    coverage = Coverage()
    for k in range(100):
        coverage.count({Case("rest", NO_FAULT)}, k >= 2, 0.0, 1.0)
    assert mostly_valid(coverage, without_faults=True)
    assert not mostly_valid(coverage, without_faults=False)


TIMES = {"gauges.jump": Allowed(1.0, True), "lines.cable": Allowed(3.0, True), "replies.lost": Allowed(1.0, False)}


def times(configuration: Any, awaited: Any, moved: bool) -> Allowed:
    return TIMES[awaited[-1].event.name]


@pytest.mark.parametrize(
    ("kind", "accepted_s", "state", "late_s"),
    [
        ("lines.cable", None, State.STOP, 13.0),
        ("lines.cable", None, State.FAULT, 18.0),
        ("lines.cable", 12.0, State.FAULT, 15.0),
        ("replies.lost", 12.0, State.FAULT, 11.0),
        ("gauges.jump", None, State.REFUSED, 11.0),
    ],
)
def test_setpoints_are_valid_again_in_time(kind: str, accepted_s: float | None, state: State, late_s: float) -> None:
    def course(valid_from_s: float) -> list[str]:
        recovery = Recovery(times)
        recovery.begins(happening(kind, ended_s=10.0))
        if accepted_s is not None:
            recovery.accepted(accepted_s)
        states = [(10.0 + k / 4, State.OK if 10.0 + k / 4 >= valid_from_s else state) for k in range(40)]
        return [text for time_s, now in states if (text := recovery.late(sight(setpoint(time_s), now)))]

    waits = state is State.FAULT and accepted_s is None
    assert not course(late_s)
    assert len(course(late_s + 1.0)) == (0 if waits else 1)


def test_nothing_is_late_while_a_fault_is_present() -> None:
    recovery = Recovery(times)
    recovery.begins(happening("lines.cable"))
    assert not recovery.late(sight(setpoint(1e6), State.STOP))


@pytest.mark.parametrize(
    ("kind", "lasts_s", "targets", "at_rest", "in_motion"),
    [
        ("computer.pause_in_motion", 0.4, (), False, False),
        ("computer.pause", 2.0, (), False, False),
        ("replies.silent", 0.1, ("scale_1",), False, False),
        ("machine.moved_while_silent", 1.5, ("scale_1",), False, True),
        ("lines.cable", 1.0, ("scale_1",), False, True),
        ("lines.gateway", 1.0, None, True, True),
        ("machine.pushed", 1.0, None, True, True),
        ("gauges.step", 1.0, ("scale_1",), True, True),
    ],
)
def test_a_person_may_be_asked_for_where_the_reference_says_so(
    kind: str, lasts_s: float, targets: tuple[str, ...] | None, at_rest: bool, in_motion: bool
) -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    awaited = [happening(kind, lasts_s, targets=targets)]
    times = [allowed(configuration, awaited, moved) for moved in (False, True)]
    assert [row.person for row in times] == [at_rest, in_motion]
    assert all(0.0 < row.within_s < 15.0 for row in times)


def test_faults_that_follow_each_other_are_as_long_as_all_of_them() -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    one = happening("replies.silent", 0.1, targets=("scale_1",))
    assert not allowed(configuration, [one], True).person
    assert allowed(configuration, [one, happening("replies.silent", 1.5, targets=("scale_1",))], True).person


def test_every_kind_with_a_cause_is_a_kind_of_fault() -> None:
    assert set(CAUSES) <= {f"{kind.family}.{kind.name}" for kind in kinds() if kind.fault}
