"""What effects need: the quantities that gauges must deliver, and what to do where one is missing."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Mapping

from compd.errors import Problem
from compd.link_count import scale_count
from compd.model.effects.effect import Effect, Port

# The words that an effect's `needs` may hold beside names of quantities, and what each stands for.
NEEDS: Mapping[str, str] = {
    "force": "the force on the tip: `force_x_N`, `force_y_N`, `force_z_N`",
    "kinematics": "a machine whose kinematics compd knows",
    "scale": "the scale of each link",
    "direction": "the direction in which each link came to its place: from the scales, or columns `approach_1` ...",
    "motion": "the links' speeds: from the scales of rows that were taken on the move, or columns "
    "`velocity_1_mm_per_s` ...",
    "time": "the time of each row",
    "order": "the rows in the order in which they were measured",
    "revolute_axes": "a machine with revolute axes, that is a tripod",
    "plate_thickness_mm": "`plate_thickness_mm` in the configuration",
    "scale_signal_period_mm": "`scale_signal_period_mm` in the configuration",
}
_QUANTITIES_OF_NEED: dict[str, tuple[str, ...]] = {"force": ("force_x_N", "force_y_N", "force_z_N")}
# Needs that the machine's description meets, or that columns of a recording meet where the machine's kinematics is not
# known: what is missing where they are not met, and what to do.
_NO_QUANTITIES: Mapping[str, tuple[str, str]] = {
    "kinematics": ("the machine's kinematics, which an external model does not give", "write a machine configuration"),
    "scale": ("the scales, which were not recorded", "record columns `scale_1_mm` ..., one for each link"),
    "direction": (
        "the direction of travel, which was not recorded",
        "record columns `approach_1` ... (1 or -1), or the scales `scale_1_mm` ...",
    ),
    "motion": (
        "speeds, which were not recorded",
        "record columns `velocity_1_mm_per_s` ..., or the scales of rows taken on the move",
    ),
    "time": ("the time of each row, which was not recorded", "record a column `time_s`"),
    "order": ("the rows' order in time, which was not recorded", "record a column `time_s`"),
    "revolute_axes": (
        "revolute_axes, which this machine does not have",
        "only a tripod (kinematics: tripod_3spr) has revolute axes",
    ),
    "plate_thickness_mm": (
        "plate_thickness_mm, which this machine does not have",
        "write `plate_thickness_mm` under `geometry:`",
    ),
    "scale_signal_period_mm": (
        "scale_signal_period_mm, which this machine does not have",
        "write `scale_signal_period_mm` under `geometry:`",
    ),
}
# Those that no column of a recording can meet.
# What a machine of known kinematics must have for a port to be there, and how that is said where it has not.
_PORTS_OF: Mapping[Port, tuple[str, str, str]] = {
    "frame": ("frame_points", "frame, of which this machine's configuration states no places", "`supports_B_mm`"),
    "plate": ("frame_points", "plate, of which this machine's configuration states no places", "`plate_points_M_mm`"),
    "joint": ("joint_comparators", "joint, and no comparator measures a joint of this machine", "`wiring: joint:`"),
    "revolute_axis": ("revolute_axes", "revolute_axis, and this machine has no revolute axes", "`hinges`"),
}
_DESCRIBED = frozenset({"kinematics", "revolute_axes", "plate_thickness_mm", "scale_signal_period_mm"})
_GAUGE_OF_QUANTITY = {
    "temperature": "a thermometer",
    "force": "a force gauge",
    "pressure": "a barometer",
    "humidity": "a hygrometer",
}

# `difflib` ratio above which two names are taken for spellings of one: "humdity_pct", not "force_x_N".
_ALIKE = 0.85
_NUMBER = re.compile(r"\d+")


def needed_quantities(effect: Effect, links: int) -> list[str]:
    """The measured quantities that the effect needs, by their full names."""
    quantities: list[str] = []
    for need in effect.needs:
        if "{link}" in need:
            quantities += [need.format(link=i + 1) for i in range(links)]
        elif "{scale}" in need:
            quantities += [need.format(scale=i + 1) for i in range(scale_count(links))]
        elif "{axis}" in need:
            quantities += [need.format(axis=axis) for axis in "xyz"]
        elif need in _QUANTITIES_OF_NEED:
            quantities += _QUANTITIES_OF_NEED[need]
        elif need not in _NO_QUANTITIES:
            quantities.append(need)
    return quantities


def is_measured(effect: Effect) -> bool:
    """Whether the effect is computed from measured quantities, which count from some conditions."""
    return effect.counts_from != "its own" and bool(needed_quantities(effect, 1))


def needed_at_zero(effect: Effect, links: int) -> list[str]:
    """The measured quantities whose values at machine zero the effect needs, by their full names."""
    return needed_quantities(effect, links) if effect.counts_from == "machine zero" else []


def unmet_needs(
    effect: Effect, available: Collection[str], links: int, at_zero: Collection[str] | None = None
) -> list[Problem]:
    """One problem for each thing that the effect needs and does not get; empty where it can be used.

    available : names of the quantities that gauges or columns deliver, and of the settings that the machine has
        (`Observations.available`, or `available_settings` beside the wiring's quantities).
    at_zero : names of the quantities that are known at machine zero; None where effects do not count from there.
    """
    problems = [
        Problem(
            f"effect {effect.id}",
            f"needs {name}, which no gauge measures",
            next_step=(name in effect.needs and _similar(name, available))
            or _gauge_to_add(name, "kinematics" in available),
        )
        for name in _missing_quantities(effect, available, links)
    ]
    for need in effect.needs:
        if need in _NO_QUANTITIES and need not in available:
            missing, next_step = _NO_QUANTITIES[need]
            problems.append(Problem(f"effect {effect.id}", f"needs {missing}", next_step=next_step))
    if at_zero is not None:
        problems += [
            Problem(
                f"effect {effect.id}",
                f"needs {name} as it was at machine zero, where it was not measured",
                allowed=", ".join(sorted(at_zero)) or "nothing was measured there",
                next_step="take machine zero again: `compd zero`; in a recording write it into its sidecar, under "
                "`quantities_at_zero:`",
            )
            for name in needed_at_zero(effect, links)
            if name in available and name not in at_zero
        ]
    if "kinematics" in available and all(
        port in _PORTS_OF and _PORTS_OF[port][0] not in available for port in effect.ports
    ):
        _, what, key = _PORTS_OF[effect.ports[0]]
        already = any(need in effect.needs for need in _DESCRIBED - {"kinematics"} if need not in available)
        if not already:
            problems.append(
                Problem(
                    f"effect {effect.id}", f"acts at the port {what}", next_step=f"write {key} where the machine has it"
                )
            )
    if not _reaches_prediction(effect, available, links):
        problems.append(
            Problem(
                f"effect {effect.id}",
                f"acts at the port {effect.port}, which an external model has not",
                allowed="effects at the ports "
                + ", ".join(dict.fromkeys([*(["reference"] if OWN_POSE in available else []), *external_ports(links)])),
                next_step="write a machine configuration",
            )
        )
    return problems


def can_concern(effect: Effect, available: Collection[str], links: int) -> bool:
    """Whether measuring more could make the effect usable on this machine, if it is not yet.

    On a machine whose kinematics is not known, nothing can be said of effects that act inside it.

    available, links : as in `unmet_needs`.
    """
    if "kinematics" in available:
        return True
    return _reaches_prediction(effect, available, links) and _DESCRIBED.isdisjoint(effect.needs)


def _reaches_prediction(effect: Effect, available: Collection[str], links: int) -> bool:
    """Whether what the effect adds can be carried over to what was predicted.

    Without known kinematics only what acts on the predicted coordinates themselves: on link lengths what their scales
    and the links add, on the tip what the reference adds.
    """
    if OWN_POSE in available:
        return set(effect.ports) <= {"reference", *(external_ports(links) if links else ())}
    return "kinematics" in available or any(port in effect.ports for port in external_ports(links))


# Among what is available: the pose is known with its derivatives, so that what acts on links is carried to it.
OWN_POSE = "own pose"


def external_ports(links: int) -> tuple[Port, ...]:
    """Where effects can act on what an external model predicted: on lengths of so many links, or on the tip."""
    return ("scale", "link") if links else ("reference",)


def _missing_quantities(effect: Effect, available: Collection[str], links: int) -> list[str]:
    """What of `needed_quantities` is not available; of a need for each axis one axis is enough."""
    of_axes = {need: [need.format(axis=axis) for axis in "xyz"] for need in effect.needs if "{axis}" in need}
    enough = {name for names in of_axes.values() if any(name in available for name in names) for name in names}
    return [name for name in needed_quantities(effect, links) if name not in available and name not in enough]


def _similar(name: str, available: Collection[str]) -> str:
    """The available quantity that was probably meant: the name without its unit, or written otherwise; "" for none."""
    with_unit = sorted(quantity for quantity in available if quantity.rpartition("_")[0] == name)
    # link 2 is not a way to write link 3
    others = [quantity for quantity in sorted(available) if _NUMBER.sub("", quantity) != _NUMBER.sub("", name)]
    close = difflib.get_close_matches(name, others, n=3, cutoff=_ALIKE)
    # temperature_tool is not a way to write temperature_room
    alike = with_unit or [other for other in close if _words_are_alike(name, other)][:1]
    return f"did you mean {' or '.join(alike)}?" if alike else ""


def _gauge_to_add(name: str, wired: bool) -> str:
    """What to do where a quantity is missing. wired : whether compd can read the machine's gauges."""
    gauge = _GAUGE_OF_QUANTITY.get(name.partition("_")[0], "a gauge")
    if not wired:
        return f"read {gauge} along and record a column `{name}`"
    return f"wire {gauge} under `wiring: quantities:` as `name: {name}`, or record a column of that name"


def _words_are_alike(name: str, other: str) -> bool:
    words, others = name.split("_"), other.split("_")
    return len(words) == len(others) and all(
        difflib.SequenceMatcher(None, word, another).ratio() >= _ALIKE
        for word, another in zip(words, others, strict=True)
    )
