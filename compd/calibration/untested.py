"""Blocks whose benefit these poses cannot test: they would change the prediction elsewhere more than where it was
measured.

Gains that follow from poses at one height improve that height, and change all others by millimetres that no pose of
the recording sees. Along a direction in which the poses are thin, and about an axis about which they hardly turn, the
prediction is looked at as far away as the poses reach along their widest direction, or its joints by its turns.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, rms
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.held_out import principal_directions
from compd.calibration.jacobian import pose_columns
from compd.calibration.machine_fit import MachineFit
from compd.calibration.pose_candidates import rows_at
from compd.model import MachineModel
from compd.model.kinematics import Mechanism, inverse_kinematics
from compd.rotation import compose, rotation_matrix, rotation_vector

_SMALLEST_MM = 1e-9


class Untested(NamedTuple):
    """blocks : why each block that cannot be tested cannot, by its place.
    thin : in words, what the poses do not vary."""

    blocks: dict[int, str]
    thin: tuple[str, ...]


class _Away(NamedTuple):
    """A step away from the poses: shift (3,) mm, turn (3,) rad, and in words what the poses do not vary."""

    shift_mm: FloatArray
    turn_rad: FloatArray
    words: str
    far: str


def untested_blocks(model: MachineModel, fit: MachineFit) -> Untested:
    """What cannot be tested; nothing where the poses spread in all that a target fixes."""
    # where the drawing has them: a fit that goes astray spreads them
    rows = [now.poses.aligned.rows.select(np.flatnonzero(now.use)) for now in fit.now]
    places_mm = np.concatenate([one.tip_M_mm for one in rows])
    attitudes = np.concatenate([one.rotation_M_P for one in rows])
    turns = rotation_vector(compose(attitudes, model.zero.rotation_M_P.T))
    steps = _steps_away(model, places_mm, turns)
    if not steps:
        return Untested({}, ())
    here = _columns(model, fit, places_mm, turns)
    found: dict[int, str] = {}
    for step in steps:
        beyond_mm = [places_mm + sign * step.shift_mm for sign in (-1.0, 1.0)]
        far = [
            _columns(model, fit, place, turns + sign * step.turn_rad)
            for sign, place in zip((-1.0, 1.0), beyond_mm, strict=True)
        ]
        for b in range(len(fit.parameters.blocks)):
            own = np.flatnonzero(fit.parameters.block_of == b)
            x = fit.result.x[own]
            moved, elsewhere = _without_motion(
                here[:, :, own] @ x, np.concatenate(far)[:, :, own] @ x, places_mm, np.concatenate(beyond_mm)
            )
            times = rms(elsewhere) / max(rms(moved), _SMALLEST_MM)
            if times > CalibrationCriteria.most_times and rms(elsewhere) > _SMALLEST_MM:
                found[b] = (
                    f"{step.words}, and {step.far} away these numbers would change the tip {times:.0f} times as much "
                    "as at the poses. Measure poses there; until then they stay as drawn."
                )
    return Untested(found, tuple(step.words for step in steps))


def _steps_away(model: MachineModel, places_mm: FloatArray, turns_rad: FloatArray) -> list[_Away]:
    """Along each direction that the poses do not vary, of those that a target fixes."""
    fixed = model.actuators.fixed == 1
    _, directions, spread_mm = principal_directions(places_mm)
    joints_mm = model.platform_joints_P_mm - model.platform_joints_P_mm.mean(axis=0)
    radius_mm = float(np.sqrt((joints_mm**2).sum(axis=1).mean()))
    turned_rad = turns_rad.std(axis=0)
    # a platform that only tilts moves its joints and hardly its tip
    widest_mm = max(float(spread_mm[0]), radius_mm * float(turned_rad.max()))
    steps = []
    for k in range(3):
        largest = int(np.abs(directions[k]).argmax())
        if spread_mm[k] < CalibrationCriteria.thin_share * widest_mm and fixed[largest]:
            words = f"all poses lie within {round(4 * spread_mm[k], 6):.2g} mm along {'xyz'[largest]}"
            steps.append(_Away(directions[k] * widest_mm, np.zeros(3), words, f"{widest_mm:.2g} mm"))
    for k, spread_rad in enumerate(turned_rad):
        if fixed[3 + k] and spread_rad * radius_mm < CalibrationCriteria.thin_share * widest_mm:
            turn_rad = min(widest_mm / radius_mm, CalibrationCriteria.farthest_turn)
            words = f"all poses lie within {round(np.degrees(4 * spread_rad), 6):.2g} deg about {'xyz'[k]}"
            steps.append(_Away(np.zeros(3), turn_rad * np.eye(3)[k], words, f"{np.degrees(turn_rad):.2g} deg"))
    return steps


def _columns(model: MachineModel, fit: MachineFit, tips_M_mm: FloatArray, turns_rad: FloatArray) -> FloatArray:
    """(R, 3, P) of the tip per tolerance at places and turns from machine zero (R, 3); nan where there is no pose."""
    zero = model.zero
    mechanism = Mechanism(model.base_joints_at_0_M_mm, model.platform_joints_P_mm, model.revolute_axes_P, model.hinges)
    wanted = compose(rotation_matrix(turns_rad), zero.rotation_M_P)
    tips_P_mm = np.broadcast_to(zero.contact.tip_P_mm, tips_M_mm.shape)
    guess_mm = np.broadcast_to(zero.actuator_mm, (len(tips_M_mm), model.scales)).copy()
    found = inverse_kinematics(mechanism, model.actuators, tips_M_mm, tips_P_mm, wanted, guess_mm)
    rows = rows_at(model, found.actuator_mm - zero.actuator_mm)
    return pose_columns(model, rows, fit.parameters)[:, :3]


def _without_motion(
    here: FloatArray, far: FloatArray, here_mm: FloatArray, far_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Changes (R, 3) and (S, 3) of the tip less the rigid motion that fits those of the first."""
    known, also = (np.isfinite(changes).all(axis=1) for changes in (here, far))
    middle_mm = here_mm[known].mean(axis=0)

    def motions(places_mm: FloatArray) -> FloatArray:
        lever = places_mm - middle_mm
        turns = [np.cross(axis, lever).ravel() for axis in np.eye(3)]
        shifts = [np.tile(axis, (len(lever), 1)).ravel() for axis in np.eye(3)]
        return np.stack([*shifts, *turns], axis=1)

    near, away = motions(here_mm[known]), motions(far_mm[also])
    motion, *_ = np.linalg.lstsq(near, here[known].ravel(), rcond=None)
    return here[known].ravel() - near @ motion, far[also].ravel() - away @ motion
