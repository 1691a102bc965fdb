"""What effects need: the quantities that gauges must deliver, and what to do where one is missing."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from compd.errors import Problem
from compd.model.effect import Effect

# The words that an effect's `needs` may hold beside names of quantities, and what each stands for.
NEEDS: Mapping[str, str] = {
    "force": "the force on the tip: `force_x_N`, `force_y_N`, `force_z_N`",
    "direction": "the direction in which each link came to its place: from the scales, or columns `approach_1` ...",
    "motion": "the links' speeds, from the scales of rows that were taken on the move",
    "time": "the time of each row",
    "order": "the rows in the order in which they were measured",
    "revolute_axes": "a machine with revolute axes, that is a tripod",
    "plate_thickness_mm": "`plate_thickness_mm` in the configuration",
    "scale_signal_period_mm": "`scale_signal_period_mm` in the configuration",
}
# Needs that stand for several quantities, or for none: direction, motion, time and order come from the scales and the
# clock, which every machine has.
_QUANTITIES_OF_NEED: dict[str, tuple[str, ...]] = {
    "force": ("force_x_N", "force_y_N", "force_z_N"),
    "direction": (),
    "motion": (),
    "time": (),
    "order": (),
}
# Needs that the machine's description meets, and what to do where it does not.
_SETTINGS = {
    "revolute_axes": "only a tripod (kinematics: tripod_3spr) has revolute axes",
    "plate_thickness_mm": "write `plate_thickness_mm` under `geometry:`",
    "scale_signal_period_mm": "write `scale_signal_period_mm` under `geometry:`",
}
_GAUGE_OF_QUANTITY = {
    "temperature": "a thermometer",
    "force": "a force gauge",
    "pressure": "a barometer",
    "humidity": "a hygrometer",
}


def needed_quantities(effect: Effect, links: int) -> list[str]:
    """The measured quantities that the effect needs, by their full names."""
    quantities: list[str] = []
    for need in effect.needs:
        if "{link}" in need:
            quantities += [need.format(link=i + 1) for i in range(links)]
        elif "{axis}" in need:
            quantities += [need.format(axis=axis) for axis in "xyz"]
        elif need in _QUANTITIES_OF_NEED:
            quantities += _QUANTITIES_OF_NEED[need]
        elif need not in _SETTINGS:
            quantities.append(need)
    return quantities


def unmet_needs(effect: Effect, available: Collection[str], links: int) -> list[Problem]:
    """One problem for each thing that the effect needs and does not get; empty where it can be used.

    available : names of the quantities that gauges or columns deliver, and of the settings that the machine has
        (`Observations.available`, or `available_settings` beside the wiring's quantities).
    """
    problems = [
        Problem(
            where=f"effect {effect.id}", what=f"needs {name}, which no gauge measures", next_step=_gauge_to_add(name)
        )
        for name in _missing_quantities(effect, available, links)
    ]
    problems += [
        Problem(
            where=f"effect {effect.id}",
            what=f"needs {need}, which this machine does not have",
            next_step=_SETTINGS[need],
        )
        for need in effect.needs
        if need in _SETTINGS and need not in available
    ]
    if effect.live and not links:
        problems.append(
            Problem(
                where=f"effect {effect.id}",
                what=f"acts at the port {effect.port}, which an external model has not",
                allowed="effects at the port `reference`",
                next_step="write a machine configuration",
            )
        )
    return problems


def _missing_quantities(effect: Effect, available: Collection[str], links: int) -> list[str]:
    """What of `needed_quantities` is not available; of a need for each axis one axis is enough."""
    of_axes = {need: [need.format(axis=axis) for axis in "xyz"] for need in effect.needs if "{axis}" in need}
    enough = {name for names in of_axes.values() if any(name in available for name in names) for name in names}
    return [name for name in needed_quantities(effect, links) if name not in available and name not in enough]


def _gauge_to_add(name: str) -> str:
    gauge = _GAUGE_OF_QUANTITY.get(name.partition("_")[0], "a gauge")
    return f"wire {gauge} under `wiring: quantities:` as `name: {name}`, or record a column of that name"
