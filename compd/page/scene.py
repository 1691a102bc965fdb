"""What the page draws of the machine: points in {M}, and how far the errors have moved them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.model.kernels.rotation import rotation_matrix, to_outer

Message = Mapping[str, Any]

# Which support and which plate point each comparator of the frame is between, as the wiring has them: t_k between the
# base platform's supports, u_k from them to the plate points.
RODS: Mapping[str, tuple[str, int, str, int]] = {
    "t1": ("support", 0, "support", 1),
    "t2": ("support", 1, "support", 2),
    "t3": ("support", 2, "support", 0),
    "u1": ("support", 0, "plate", 0),
    "u2": ("support", 0, "plate", 2),
    "u3": ("support", 1, "plate", 0),
    "u4": ("support", 1, "plate", 1),
    "u5": ("support", 2, "plate", 1),
    "u6": ("support", 2, "plate", 2),
}


class Scene:
    """The points of one machine."""

    def __init__(self, machine: Message) -> None:
        """`machine`: the MACHINE message."""
        geometry = machine["geometry"]
        base = geometry["base"]
        self._rotation_M_B = rotation_matrix(np.array(base["rotation_B0_in_M_rad"], dtype=float))
        self._origin_M_mm = np.array(base["origin_B0_in_M_mm"], dtype=float)
        self._supports_B_mm = np.array(base["supports_B_mm"], dtype=float)
        self._plate_M_mm = np.array(geometry["plate_points_M_mm"], dtype=float)

    def points(self, setpoint: Message, budget: Message | None) -> dict[str, Any] | None:
        """Points of the machine in {M}, mm, and displacements, um; None while the setpoint or the budget has none.

        The ghost is the machine as the scales alone have it: its supports where they were at machine zero, its tip
        where it was taken for. Displacements go from the ghost to the machine.
        """
        if not setpoint.get("valid") or budget is None or "platform" not in budget:
            return None
        frame = setpoint["frame"]
        turned = rotation_matrix(np.array(frame["rotation_M_rad"], dtype=float)) @ self._rotation_M_B
        supports = to_outer(turned, np.array(frame["origin_M_mm"], dtype=float), self._supports_B_mm)
        at_zero = to_outer(self._rotation_M_B, self._origin_M_mm, self._supports_B_mm)
        tip_um = np.sum(list(budget["tip_um"].values()), axis=0)
        return {
            "plate": _rounded(self._plate_M_mm, 3),
            "supports": _rounded(supports, 3),
            "base": budget["base_joints_M_mm"],
            "platform": budget["platform"]["joints_M_mm"],
            "tip": setpoint["tip_M_mm"],
            "supports_moved_um": _rounded((supports - at_zero) * 1e3, 2),
            "tip_moved_um": _rounded(tip_um, 2),
        }


def _rounded(values: FloatArray, decimals: int) -> Any:
    return np.asarray(values, dtype=float).round(decimals).tolist()
