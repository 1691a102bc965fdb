"""Blocks whose benefit these poses cannot test: they would change the prediction elsewhere more than where it was
measured.

Gains that follow from poses at one height improve that height, and change all others by millimetres that no pose of
the recording sees. Along a direction in which the poses are thin, the prediction is looked at as far away as the poses
reach along their widest direction.
"""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray, rms
from compd.calibration.held_out import THIN_SHARE, principal_directions
from compd.calibration.jacobian import pose_columns
from compd.calibration.machine_fit import MachineFit
from compd.model import MachineModel, observe
from compd.model.kinematics import Movement

# How many times as much as at the poses a block may change the prediction elsewhere.
MOST_TIMES = 3.0


def untested_blocks(model: MachineModel, fit: MachineFit) -> dict[int, str]:
    """Why each block that cannot be tested cannot; {} where the poses spread in all directions."""
    used_mm = np.concatenate([now.aligned.rows.tip_M_mm[now.use] for now in fit.now])
    _, directions, spread_mm = principal_directions(used_mm)
    fixed = model.actuators.fixed[:3] == 1
    thin = [
        k
        for k in range(3)
        if spread_mm[k] < THIN_SHARE * spread_mm[0] and np.abs(directions[k][fixed]).max(initial=0.0) > 0.5
    ]
    found: dict[int, str] = {}
    for k in thin:
        away = directions[k] * spread_mm[0]
        columns = [_columns(model, fit, used_mm + sign * away) for sign in (-1.0, 0.0, 1.0)]
        here = columns[1]
        far = np.concatenate([columns[0], columns[2]])
        if not len(here) or not len(far):
            continue
        for b in range(len(fit.parameters.blocks)):
            own = np.flatnonzero(fit.parameters.block_of == b)
            x = fit.result.x[own]
            # a rigid motion that the registration takes from the poses here is taken elsewhere, too
            moved, elsewhere = _without_motion(
                here[:, :, own] @ x, far[:, :, own] @ x, used_mm, np.concatenate([used_mm - away, used_mm + away])
            )
            if rms(elsewhere) > MOST_TIMES * rms(moved):
                found[b] = (
                    f"these poses are thin along ({', '.join(f'{v:.2f}' for v in directions[k])}), "
                    f"{2 * spread_mm[k]:.3g} mm: what they tell of it changes the tip {spread_mm[0]:.3g} mm away "
                    f"{rms(elsewhere) / max(rms(moved), 1e-12):.0f} times as much as at the poses, where nothing was "
                    "measured. Measure poses there; until then it stays as drawn."
                )
    return found


def _columns(model: MachineModel, fit: MachineFit, tips_M_mm: FloatArray) -> FloatArray:
    """(R, 3, P) of the tip per tolerance at places (R, 3), attitude as at machine zero; nan where there is no pose."""
    scale_mm = model.reach(tips_M_mm).scale_mm
    count, joints = len(tips_M_mm), model.joint_weights.shape[1]
    assert model.constants is not None
    rows = observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=np.zeros((count, joints)),
        frame_mm=np.zeros((count, 0)),
        quantities={},
        time_s=np.arange(count, dtype=np.float64),
        session_start=np.ones(count, dtype=bool),
        movement=Movement(np.zeros_like(scale_mm), np.full_like(scale_mm, np.nan), np.full((count, joints), np.nan)),
    )
    return pose_columns(model, rows, fit.parameters)[:, :3]


def _without_motion(
    here: FloatArray, far: FloatArray, here_mm: FloatArray, far_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Changes (R, 3) and (S, 3) of the tip less the rigid motion that fits those of the first."""
    here_mm, here = here_mm[np.isfinite(here).all(axis=1)], here[np.isfinite(here).all(axis=1)]
    far_mm, far = far_mm[np.isfinite(far).all(axis=1)], far[np.isfinite(far).all(axis=1)]
    middle_mm = here_mm.mean(axis=0)

    def motions(places_mm: FloatArray) -> FloatArray:
        lever = places_mm - middle_mm
        turns = [np.cross(axis, lever).ravel() for axis in np.eye(3)]
        shifts = [np.tile(axis, (len(lever), 1)).ravel() for axis in np.eye(3)]
        return np.stack([*shifts, *turns], axis=1)

    motion, *_ = np.linalg.lstsq(motions(here_mm), here.ravel(), rcond=None)
    return here.ravel() - motions(here_mm) @ motion, far.ravel() - motions(far_mm) @ motion
