"""The effects that a machine has on most of its recordings."""

from __future__ import annotations

from compd.fleet.steady_effects import LoneEffect, lone_effects, steady_effects
from tests.support.fleets import expansion, machine, result


def test_an_effect_counts_on_more_than_half_of_the_recordings() -> None:
    results = [
        *machine("always", [1.0, 1.0]),
        *(result("half", k, [expansion(1.0)] if k else []) for k in (0, 1)),
        *(result("mostly", k, [expansion(1.0)] if k else []) for k in (0, 1, 2)),
    ]
    assert steady_effects(results) == {
        "always": {"link_expansion"},
        "half": frozenset(),
        "mostly": {"link_expansion"},
    }


def test_a_machine_that_alone_has_an_effect() -> None:
    others = [result(f"m{k}", campaign) for k in range(5) for campaign in range(2)]
    alone = machine("m9", [1.0, 1.1])
    assert lone_effects([*others, *alone]) == (LoneEffect("m9", "link_expansion", 2, 2, 6),)
    assert lone_effects([*others, *alone, *machine("m8", [1.0, 1.0])]) == ()
    assert lone_effects([*others[2:], *alone]) == ()
    assert lone_effects([*others, *alone[:1]]) == ()
