"""Was it right? One line of results against its secret."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

# A cause that follows the tip's place shows along any of the tip's coordinates.
POSITION = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
# Two-sided 95 % of a normal distribution.
WITHIN_STD = 1.96
# Effects whose truth has the library's own form, so that its parameters have a true value: their numbers are
# the same quantity. Elsewhere (a round loop, a thermal chain, a stand that creeps less every day) there is none.
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
    """The effect that is named first; "-" for none."""
    return steps(result)[0]["effect"] if steps(result) else "-"


def named_first(result: Result) -> bool:
    return first(result) in result["secret"]["answers"]


def all_named(result: Result) -> bool:
    """Every hidden effect of the library is a step or a step's rival."""
    named = {name for step in steps(result) for name in (step["effect"], *step["rivals"])}
    return named >= set(result["secret"]["answers"])


def named_wrongly(result: Result) -> list[str]:
    """Steps in which neither the effect nor a rival was hidden."""
    truth = set(result["secret"]["answers"])
    return [step["effect"] for step in steps(result) if not truth & {step["effect"], *step["rivals"]}]


def adequate(result: Result) -> bool:
    return bool(result["verdict"]["verdict"] == "adequate")


def follows(secret: Mapping[str, Any]) -> set[str]:
    """The covariates by which a cause outside the library may be known."""
    return {name for one in secret["follows"] for name in (POSITION if one == "position" else (one,))}


def covariate_found(result: Result) -> bool:
    """What a cause outside the library follows is first or second in `depends_on`."""
    told = {one["covariate"] for one in result["verdict"]["depends_on"][:2]}
    return bool(follows(result["secret"]) & told)


def intervals(result: Result) -> Iterator[tuple[str, bool]]:
    """(effect, whether its 95 % interval holds the true value) of every number that has a true value."""
    secret = result["secret"]
    for entry in result["fitted"]:
        name = entry["effect"]
        if name not in SAME_FORM or name not in secret["effects"]:
            continue
        true = secret["effects"][name]
        values = true if isinstance(true, list) else [true]
        if len(values) != len(entry["parameters"]):
            continue
        for value, number in zip(values, entry["parameters"], strict=True):
            if math.isfinite(number["std"]):
                yield name, abs(number["value"] - value) <= WITHIN_STD * number["std"]
