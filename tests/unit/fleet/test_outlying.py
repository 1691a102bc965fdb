"""Machines that differ from the others in a parameter or in their error."""

from __future__ import annotations

from dataclasses import replace

from compd.fleet.drift import drifts
from compd.fleet.outlying import ERROR, OutlyingMachine, outlying_machines
from compd.fleet.recording_result import RecordingResult
from tests.support.fleets import expansion, machine, result

ALIKE = [1.10, 1.12, 1.09, 1.11, 1.08, 1.13, 1.10]


def fleet(values: list[float], errors: list[float] | None = None) -> list[RecordingResult]:
    errors = errors or [0.50, 0.51, 0.49, 0.52, 0.48, 0.50, 0.51, 0.49][: len(values)]
    return [
        campaign
        for k, (value, error) in enumerate(zip(values, errors, strict=True))
        for campaign in machine(f"m{k}", [value, value], rms_before_um=error)
    ]


def outlying(results: list[RecordingResult]) -> tuple[OutlyingMachine, ...]:
    return outlying_machines(results, drifts(results))


def test_machines_that_are_alike_do_not_differ() -> None:
    assert outlying(fleet(ALIKE)) == ()


def test_a_parameter_that_is_far_off_is_named() -> None:
    (found,) = outlying(fleet([*ALIKE, 2.5]))
    assert (found.machine, found.quantity, found.unit) == ("m7", "link_expansion.a", "ppm/K")
    assert found.machines == 8
    assert 1.09 <= found.median <= 1.12


def test_a_value_that_is_not_known_better_is_not_named() -> None:
    results = fleet(ALIKE)
    assert outlying([*results, *machine("m7", [2.5, 2.5], 1.0, rms_before_um=0.5)]) == ()


def test_an_error_that_is_far_off_is_named() -> None:
    (found,) = outlying(fleet(ALIKE, [0.50, 0.51, 0.49, 0.52, 0.48, 0.50, 3.0]))
    assert (found.machine, found.quantity, found.machines) == ("m6", ERROR, 7)


def test_an_error_that_comes_and_goes_is_not_named() -> None:
    results = fleet(ALIKE)
    changing = [
        replace(result, rms_before_um=error)
        for result, error in zip(machine("m7", [1.1] * 4), (0.3, 0.6, 0.9, 1.4), strict=True)
    ]
    assert outlying([*results, *changing]) == ()


def test_a_machine_that_is_built_otherwise_is_not_compared() -> None:
    assert outlying([*fleet(ALIKE), *machine("h1", [2.5, 2.5], kinematics="hexapod_6ups", rms_before_um=3.0)]) == ()


def test_an_error_is_compared_among_machines_with_the_same_effects() -> None:
    others = [result(f"n{k}", campaign, rms_before_um=0.16) for k in range(8) for campaign in range(2)]
    assert outlying([*fleet(ALIKE), *others]) == ()


def test_an_effect_on_one_recording_makes_no_machine_differ() -> None:
    found_once = [result("m7", 0, [expansion(1.1)], rms_after_um=0.21), *(result("m7", k) for k in (1, 2, 3))]
    others = [result(f"n{k}", campaign) for k in range(8) for campaign in range(4)]
    assert outlying([*others, *found_once]) == ()


def test_few_machines_have_no_rule() -> None:
    assert outlying(fleet([1.0, 1.0, 1.01, 9.0])) == ()
