"""Scores of one result: the diagnosis against what was hidden."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

# Covariates of a cause that depends on the tip's position: any of its coordinates.
POSITION = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
# Two-sided 95 % of a normal distribution.
WITHIN_STD = 1.96
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

Result = Mapping[str, Any]


def steps(result: Result) -> list[dict[str, Any]]:
    return list(result["verdict"]["steps"])


def first(result: Result) -> str:
    """Effect of the diagnosis' first step; "-" for none."""
    return steps(result)[0]["effect"] if steps(result) else "-"


def named_first(result: Result) -> bool:
    return first(result) in result["secret"]["answers"]


def all_named(result: Result) -> bool:
    """Whether every hidden effect of the library is a step's effect or rival."""
    named = {name for step in steps(result) for name in (step["effect"], *step["rivals"])}
    return named >= set(result["secret"]["answers"])


def named_wrongly(result: Result) -> list[str]:
    """Effects of steps in which neither the effect nor a rival was hidden."""
    truth = set(result["secret"]["answers"])
    return [step["effect"] for step in steps(result) if not truth & {step["effect"], *step["rivals"]}]


def adequate(result: Result) -> bool:
    return bool(result["verdict"]["verdict"] == "adequate")


def follows(secret: Mapping[str, Any]) -> set[str]:
    """Covariates by which the hidden causes outside the library can be described."""
    return {name for covariate in secret["follows"] for name in (POSITION if covariate == "position" else (covariate,))}


def covariate_found(result: Result) -> bool:
    """Whether one of these covariates is first or second in `depends_on`."""
    proposed = {trend["covariate"] for trend in result["verdict"]["depends_on"][:2]}
    return bool(follows(result["secret"]) & proposed)


def intervals(result: Result) -> Iterator[tuple[str, bool]]:
    """(effect, whether its 95 % interval holds the true value) of every number that has a true value."""
    secret = result["secret"]
    for entry in result["fitted"]:
        name = entry["effect"]
        if name not in SAME_FORM or name not in secret["effects"]:
            continue
        strength = secret["effects"][name]
        true_values = strength if isinstance(strength, list) else [strength]
        if len(true_values) != len(entry["parameters"]):
            continue
        for true_value, parameter in zip(true_values, entry["parameters"], strict=True):
            if math.isfinite(parameter["std"]):
                yield name, abs(parameter["value"] - true_value) <= WITHIN_STD * parameter["std"]
