"""Rows of the drawings' machines under weather and load, for the tests of effects; a closure of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from compd.model import MachineModel, effect_deltas, machine_constants, observe
from compd.model.effects import Effect, MachineDetails, Observations
from compd.model.kinematics import Movement
from compd.model.library import load_library
from compd.model.library.scale import PERIODS_MM
from tests.support.model_machines import Floats, hexapod, inverse_pose, tips, tripod

DETAILS = MachineDetails(plate_thickness_mm=200.0, scale_signal_period_mm=0.020)
TRIPOD, HEXAPOD = tripod(), hexapod()
LIBRARY = load_library()
PLACES = ("room", "base", "frame", "platform", "tool", "plate_top", "plate_bottom")


def all_quantities(links: int, rows: int, values: Mapping[str, Any]) -> dict[str, Floats]:
    """Everything that the library may need: 20 degC, no load, 1013.25 hPa, but for `values`."""
    names = [f"temperature_{place}_degC" for place in (*PLACES, *(f"link_{i + 1}" for i in range(links)))]
    still: dict[str, Any] = dict.fromkeys(names, 20.0)
    still |= {"force_x_N": 0.0, "force_y_N": 0.0, "force_z_N": 0.0, "pressure_hPa": 1013.25, "humidity_pct": 50.0}
    return {name: np.broadcast_to(np.asarray(value, float), (rows,)) for name, value in (still | dict(values)).items()}


def rows_at_tips(
    model: MachineModel, tip_M_mm: Floats, values: Mapping[str, Any] | None = None, **given: Any
) -> Observations:
    """Rows at these tips with perfect gauges; `values` by quantity, `given` by argument of `observe`."""
    count, n, k = len(tip_M_mm), model.links, model.joint_weights.shape[1]
    zero = model.zero
    pose = inverse_pose(
        model, model.mechanism(zero.base_joints_M_mm), tip_M_mm, zero.contact.tip_P_mm, zero.rotation_M_P
    )
    arguments: dict[str, Any] = {
        "scale_mm": pose.link_length_mm - zero.link_length_mm,
        "joint_mm": np.zeros((count, k)),
        "frame_mm": np.zeros((count, 9)),
        "quantities": all_quantities(n, count, values or {}),
        "time_s": 25.0 * np.arange(count),
        "session_start": np.arange(count) == 0,
        "movement": Movement(np.ones((count, n)), np.zeros((count, n)), np.zeros((count, k))),
    }
    return observe(model, machine_constants(model, DETAILS), **(arguments | given))


def row_at_zero(model: MachineModel = TRIPOD, values: Mapping[str, Any] | None = None, **given: Any) -> Observations:
    """One row at machine zero."""
    return rows_at_tips(model, model.zero.contact.tip_M_mm[None], values, **given)


def random_inputs(model: MachineModel, rows: int = 24, seed: int = 3) -> dict[str, Any]:
    """Arguments of `observe` in which nothing is zero: two sessions, uneven times, weather, load, moving links; machine
    zero was taken in other weather."""
    rng = np.random.default_rng(seed)
    n, k = model.links, model.joint_weights.shape[1]
    around = rows_at_tips(model, tips(model, rows, seed, 60.0))
    weather = {name: 20.0 + rng.normal(0, 1, rows) for name in around.quantities if name.startswith("temperature")}
    load = {f"force_{axis}_N": rng.normal(0, 30, rows) for axis in "xyz"}
    return {
        "scale_mm": around.scale_mm,
        "joint_mm": rng.normal(0, 5e-3, (rows, k)),
        "frame_mm": rng.normal(0, 5e-3, (rows, 9)),
        "quantities": weather
        | load
        | {"pressure_hPa": rng.normal(1010, 5, rows), "humidity_pct": rng.normal(50, 9, rows)},
        "time_s": np.cumsum(rng.uniform(1, 300, rows)),
        "session_start": np.isin(np.arange(rows), [0, rows // 2]),
        "movement": Movement(
            np.sign(rng.normal(size=(rows, n))), rng.normal(0, 40, (rows, n)), rng.normal(0, 1e-3, (rows, k))
        ),
        "quantities_at_zero": {name: 22.0 + 0.1 * index for index, name in enumerate(weather)}
        | dict.fromkeys(load, -4.0)
        | {"pressure_hPa": 1002.0, "humidity_pct": 44.0},
    }


def observe_rows(model: MachineModel, arguments: Mapping[str, Any]) -> Observations:
    """The rows of such arguments."""
    return observe(model, machine_constants(model, DETAILS), **arguments)


def select_rows(arguments: Mapping[str, Any], which: slice) -> dict[str, Any]:
    """Some of the rows."""
    return {
        "quantities": {name: values[which] for name, values in arguments["quantities"].items()},
        "movement": Movement(*(values[which] for values in arguments["movement"])),
    } | {
        name: value if name == "quantities_at_zero" else value[which]
        for name, value in arguments.items()
        if name not in ("quantities", "movement")
    }


def constants_of(effect: Effect) -> dict[str, float]:
    """Shape constants with which something happens between rows of `varied`."""
    some = {"p": PERIODS_MM[4], "d": 30.0, "tau": 240.0}
    return {constant.name: some.get(constant.name, constant.grid[-1]) for constant in effect.constants}


def delta_mm(id_: str, rows: Observations, *theta: float, **shape: float) -> Floats:
    """What one effect adds at its first port, (N, size), for these numbers."""
    from compd.model.effects import FittedEffect

    effect = LIBRARY[id_]
    found, _ = effect_deltas(FittedEffect(effect, np.array(theta), shape), rows)
    return found[effect.ports[0]]


def solve_tip(model: MachineModel, lengths_mm: Floats, **moved: Floats) -> Floats:
    """The tip (3,) by scipy's solver on the closure written out, with base_M, joints_P or axes_P moved."""
    zero = model.zero
    base = zero.base_joints_M_mm + moved.get("base_M", 0.0)
    joints = model.platform_joints_P_mm + moved.get("joints_P", 0.0)
    axes = model.revolute_axes_P + moved.get("axes_P", 0.0)

    def closing(pose: Floats) -> Floats:
        R = Rotation.from_rotvec(pose[3:] / 100).as_matrix() @ zero.rotation_M_P
        links = zero.platform_origin_M_mm + pose[:3] + joints @ R.T - base
        square = (links[: len(axes)] * (axes @ R.T)).sum(axis=1)
        return np.concatenate([np.linalg.norm(links, axis=1) - lengths_mm, square])

    pose, _, _, message = fsolve(closing, np.zeros(6), xtol=1e-13, full_output=True)
    assert np.abs(closing(pose)).max() < 1e-9, message
    R = Rotation.from_rotvec(pose[3:] / 100).as_matrix() @ zero.rotation_M_P
    return np.asarray(zero.platform_origin_M_mm + pose[:3] + R @ zero.contact.tip_P_mm)
