"""Geometry for the page's picture of the machine: points in {M} and their displacements by errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

Message = Mapping[str, Any]


def scene(machine: Message, setpoint: Message, budget: Message | None) -> dict[str, Any] | None:
    """Points of the machine in {M} (mm) and displacements (um); None if the setpoint or the budget lacks them.

    The ghost is the machine as the scales alone have it: its supports where they were at machine zero, its tip where it
    was taken for. Displacements go from the ghost to the machine.

    Without points of the surface plate there is no frame: `plate` and the supports are empty.

    machine, setpoint, budget : the messages MACHINE, SETPOINT and BUDGET.
    """
    if not setpoint.get("valid") or budget is None or "platform" not in budget:
        return None
    has_frame = "plate_points_M_mm" in machine["geometry"]
    return {
        "plate": machine["geometry"]["plate_points_M_mm"] if has_frame else [],
        "supports": budget["supports_M_mm"] if has_frame else [],
        "base": budget["base_joints_M_mm"],
        "platform": budget["platform"]["joints_M_mm"],
        "tip": setpoint["tip_M_mm"],
        "rotation": budget["platform"]["rotation_M_rad"],
        "supports_moved_um": budget["supports_moved_um"] if has_frame else [],
        "tip_moved_um": moved_um(budget),
    }


def moved_um(budget: Message) -> list[float]:
    """Displacement of the tip by all causes together in x, y, z (um)."""
    return [sum(axis) for axis in zip(*budget["tip_um"].values(), strict=True)]
