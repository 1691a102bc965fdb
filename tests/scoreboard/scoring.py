"""Scores of one result: what the diagnosis said against what was hidden."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tests.scoreboard.case import CONSTANT_CAUSES
from tests.scoreboard.expectation import Expectation

# Two-sided 95 % of a normal distribution.
WITHIN_STD = 1.96
# Share of the rows between the true and the reported time of a change.
CHANGE_WITHIN = 0.1
# Words that a user takes as the end of the search.
FINAL = ("identified", "adequate")
# Effects for which truth and library have the same equation, so that the parameters have true values. The others
# (hysteresis, thermal chains, creep) have none.
SAME_FORM = (
    "scale_gain",
    "joint_comparator_gain",
    "frame_comparator_gain",
    "tool_offset",
    "link_zero",
    "base_joint_position",
    "platform_joint_position",
    "revolute_axis_tilt",
)

# A line of the results: `case`, `family`, `verdict` (JSON of the diagnosis), `expected`, `answer`, `times_s`.
Result = Mapping[str, Any]


@dataclass(frozen=True)
class Score:
    """Attributes
    ----------
    right : a right word, everything named that should be, nothing else.
    near : what should be named is named or among the rivals, although something else is off.
    dangerous : `identified` or `adequate`, wrongly.
    missing : what a right diagnosis has and this one has not, in words.
    """

    right: bool
    near: bool
    dangerous: bool
    missing: tuple[str, ...]


def steps(result: Result) -> list[dict[str, Any]]:
    return list(result["verdict"]["steps"])


def names(result: Result) -> list[str]:
    """The effects that are named, in their order."""
    return [step["effect"] for step in steps(result)]


def constant_effects(result: Result) -> set[str]:
    """Effects from which a constant, reported on a line of its own, may come."""
    return set((result["verdict"].get("constant") or {}).get("effects", ()))


def rivals(result: Result) -> set[str]:
    return {name for step in steps(result) for name in step["rivals"]}


def score(result: Result) -> Score:
    """The diagnosis against the expectation."""
    expected = Expectation.from_json(result["expected"])
    verdict = result["verdict"]
    named, constant, possible = names(result), constant_effects(result), rivals(result)
    # a group may have a covariate as well, where a description says what a cause would
    told = {*named, *constant, *_followed(result), *(possible if expected.or_rival else ())}
    absent = [group for group in expected.groups if not told & set(group)]
    hidden = [group for group in absent if not possible & set(group)]
    missing = [f"not named: {' or '.join(group)}" for group in absent]
    missing += [f"named: {name}" for name in wrongly_named(result, expected)]
    missing += [f"not reported as a constant: {' or '.join(group)}" for group in _no_constant(result, expected)]
    missing += [*_not_followed(result, expected), *_change_missing(result, expected)]
    missing += _residual_and_rows(result, expected)
    if verdict["verdict"] == "identified":
        unsaid = [group for group in expected.identified_needs if not {*named, *constant} & set(group)]
        missing += [f"identified without {' or '.join(group)}" for group in unsaid]
    if verdict["verdict"] not in expected.verdicts:
        missing.append(f"verdict {verdict['verdict']}")
    right = not missing
    dangerous = not right and verdict["verdict"] in FINAL
    near = right or not (dangerous or hidden or _only_wrong_names(result, expected) or _unmentioned(result, expected))
    return Score(right, near, dangerous, tuple(missing))


def wrongly_named(result: Result, expected: Expectation, *, with_rivals: bool = True) -> list[str]:
    """Steps whose effect was not hidden; also those that must not be named, or not without a rival.

    with_rivals : whether a rival that is there excuses a step, where the expectation has `or_rival`.
    """
    allowed = {name for group in (*expected.groups, *expected.constant_or) for name in group}
    # the weak disturbances are there, too: none has to be named, and each may be
    allowed |= {*expected.may_name, *expected.constant, *result["answer"].get("weak_disturbances", ())}
    forbidden = [name for name in names(result) if name in expected.never]
    if result["family"] == "real":
        # nobody planted anything: effects that the answers do not mention may be there
        alone = {step["effect"] for step in steps(result) if not step["rivals"]}
        return forbidden + [name for name in expected.never_alone if name in alone]
    told = [
        ({step["effect"], *(step["rivals"] if with_rivals and expected.or_rival else ())}, step["effect"])
        for step in steps(result)
    ]
    return [name for either, name in told if not either & allowed]


def _only_wrong_names(result: Result, expected: Expectation) -> bool:
    """Whether an effect is named, without a rival that may be, where none should be."""
    wrong = wrongly_named(result, expected)
    may = set(expected.may_name)
    return not expected.groups and any(s["effect"] in wrong and not may & set(s["rivals"]) for s in steps(result))


def _unmentioned(result: Result, expected: Expectation) -> bool:
    """Whether the effect that changes is neither named nor reported to change."""
    if expected.change is None:
        return False
    mentioned = {entry.get("effect") for entry in result["verdict"]["depends_on"]}
    mentioned |= {*names(result), *rivals(result), *constant_effects(result)}
    return not mentioned & set(expected.change.effects)


def _no_constant(result: Result, expected: Expectation) -> list[tuple[str, ...]]:
    reported = {*names(result), *constant_effects(result), *rivals(result)}
    groups = [*((name,) for name in expected.constant), *expected.constant_or]
    return [group for group in groups if not reported & set(group)]


def _not_followed(result: Result, expected: Expectation) -> list[str]:
    followed = _followed(result, expected.first)
    wrong = [f"follows {name}" for name in expected.never_follows if name in followed]
    return wrong + [f"does not say that it follows {' or '.join(g)}" for g in expected.follows if not followed & set(g)]


def _followed(result: Result, first: int = 0) -> set[str | None]:
    """What the rest follows, by the first findings; 0 for all."""
    entries = result["verdict"]["depends_on"][: first or None]
    return {name for entry in entries for name in (entry.get("covariate"), *entry.get("beside", ()))}


def _change_missing(result: Result, expected: Expectation) -> list[str]:
    """Whether the change was reported, with its effect and its time."""
    change = expected.change
    if change is None:
        return []
    reported = [_reported_change(entry) for entry in result["verdict"]["depends_on"]]
    times_s = [time_s for effects, time_s in reported if time_s is not None and effects & set(change.effects)]
    if not times_s:
        return [f"does not say that {' or '.join(change.effects)} changes"]
    off = min(_share_between(result["times_s"], change.time_s, time_s) for time_s in times_s)
    return [f"the time of the change is off by {100 * off:.0f} % of the rows"] if off > CHANGE_WITHIN else []


def _reported_change(entry: Mapping[str, Any]) -> tuple[set[str], float | None]:
    """(effects that may have changed, when) by an entry of `depends_on`; a step in time is a constant that begins."""
    if entry.get("form") == "change":
        return {entry["effect"]}, entry["time_s"]
    step = re.search(r"time_s - ([\d.]+)", (entry.get("formula_effect") or {}).get("formula", ""))
    if entry.get("form") == "step" and step:
        return set(CONSTANT_CAUSES), float(step[1])
    return set(), None


def _share_between(times_s: list[float], first_s: float, second_s: float) -> float:
    low, high = sorted((first_s, second_s))
    return sum(low <= time_s < high for time_s in times_s) / len(times_s)


def _residual_and_rows(result: Result, expected: Expectation) -> list[str]:
    verdict = result["verdict"]
    missing = []
    # with what is named, or with what describes the rest
    described_um = [entry.get("heldout_rms_um") for entry in verdict["depends_on"]]
    left_um = min([verdict["final_rms_um"], *(value for value in described_um if value is not None)])
    if expected.left_um is not None and left_um > expected.left_um:
        missing.append(f"leaves {left_um:.3g} um, not {expected.left_um:g}")
    if expected.left_um_at_least is not None and left_um < expected.left_um_at_least:
        missing.append(f"leaves {left_um:.3g} um, where {expected.left_um_at_least:.3g} cannot be taken away")
    gross, at_most = len(verdict["outlier_rows"]), expected.gross_rows_at_most
    if gross < expected.gross_rows or (at_most is not None and gross > at_most):
        missing.append(f"{gross} gross rows, not {expected.gross_rows if at_most is None else f'at most {at_most}'}")
    return missing


def intervals(result: Result) -> Iterator[tuple[str, bool]]:
    """(effect, whether its 95 % interval holds the true value) of every number that has a true value."""
    for step in steps(result):
        name = step["effect"]
        if name not in SAME_FORM or name not in result["answer"]["effects"]:
            continue
        strength = result["answer"]["effects"][name]
        true_values = strength if isinstance(strength, list) else [strength]
        if len(true_values) != len(step["parameters"]):
            continue
        for true_value, parameter in zip(true_values, step["parameters"], strict=True):
            if parameter["std"] is not None and math.isfinite(parameter["std"]):
                yield name, abs(parameter["value"] - true_value) <= WITHIN_STD * parameter["std"]
