"""Combinations of a machine's numbers that measured poses cannot tell, in words, and what would tell them.

The covariance C after the poses is compared with the prior S before: the eigenvalues of S^-1/2 C S^-1/2 are 1 along
combinations of which the poses tell nothing, and near 0 along those that they tell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.calibration.calibration import HeldCombination
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.parameters import Parameters
from compd.calibration.prior_fit import Normal
from compd.model import MachineModel

# Share of a motion that lies in what is held, from which its name says what is held.
_NAMED_SHARE = 0.7
# Members that words name of another combination, and the share of the largest that one must have.
_MEMBERS, _MEMBER_SHARE = 4, 0.5
# Standard deviations by which a scale of all lengths by a tolerance must move the measurements.
_TOLD = 1.0

_FRAME_REMEDY = "measure in the machine's own frame, or take the instrument's frame for the machine's: nothing is lost"
_PLATFORM_REMEDY = (
    "say where the target is on the platform (--hold target.place), or take it for the tip: nothing is lost"
)
_MORE_POSES = "poses farther apart and more tilted, in the parts of the workspace that these leave out"


class _Motion(NamedTuple):
    words: str
    remedy: str
    vector: FloatArray


def held_combinations(
    model: MachineModel,
    parameters: Parameters,
    C: FloatArray,
    prior: FloatArray,
    free: BoolArray,
    registered: bool,
) -> tuple[HeldCombination, ...]:
    """C : (P, P) after the poses, prior : (P,) standard deviations before, both in tolerances. free : (P,) numbers of
    blocks of the machine as built.  registered : whether an instrument's frame was fitted along."""
    place = np.flatnonzero(free)
    if not len(place):
        return ()
    relative = C[np.ix_(place, place)] / np.outer(prior[place], prior[place])
    values, vectors = np.linalg.eigh((relative + relative.T) / 2)
    shares = np.sqrt(np.clip(values, 0.0, None))
    open_ = vectors[:, shares > CalibrationCriteria.held_share]
    open_shares = shares[shares > CalibrationCriteria.held_share]
    result = []
    for motion in _motions(model, parameters):
        own = (motion.vector / prior / parameters.prior_std)[place]
        size = np.linalg.norm(own)
        if not open_.shape[1] or not size:
            continue
        inside = open_.T @ (own / size)
        if np.linalg.norm(inside) < _NAMED_SHARE:
            continue
        direction = open_ @ inside / np.linalg.norm(inside)
        share = float(np.sqrt(np.sum((inside / np.linalg.norm(inside)) ** 2 * open_shares**2)))
        remedy = motion.remedy if registered else _MORE_POSES
        result.append(HeldCombination(motion.words, remedy, _whole(direction, place, len(prior)), share))
        # what is left of the held space beside this motion
        rest = np.linalg.svd((inside / np.linalg.norm(inside))[None, :])[2][1:]
        open_shares = np.sqrt((rest**2) @ (open_shares**2))
        open_ = open_ @ rest.T
    for k in range(open_.shape[1]):
        weights = _whole(open_[:, k], place, len(prior))
        result.append(HeldCombination(_members(weights, parameters), _MORE_POSES, weights, float(open_shares[k])))
    return tuple(result)


def length_scale_is_told(model: MachineModel, parameters: Parameters, normal: Normal) -> bool:
    """Whether the measurements would show if all places and lengths were larger by the same share."""
    vector = _scaled(model, parameters)
    if not vector.any():
        return True
    x = vector / parameters.prior_std
    x = x / np.abs(x).max()
    return bool(x @ normal.A @ x > _TOLD)


def _motions(model: MachineModel, parameters: Parameters) -> list[_Motion]:
    """Motions of all base joints, of all platform joints, and a growth of everything; in the effects' units."""
    base_mm, platform_mm = model.base_joints_at_0_M_mm, model.platform_joints_P_mm
    motions = []
    for block, joints_mm, words, remedy in (
        ("base_joint_position", base_mm, "all base joints together", _FRAME_REMEDY),
        ("platform_joint_position", platform_mm, "all platform joints together", _PLATFORM_REMEDY),
    ):
        lever_mm = joints_mm - joints_mm.mean(axis=0)
        for axis, e in zip("xyz", np.eye(3), strict=True):
            shifted = np.tile(e, (len(joints_mm), 1))
            motions.append(_Motion(f"{words}, along {axis}", remedy, _at(parameters, block, shifted)))
            turned = np.cross(e, lever_mm)
            motions.append(_Motion(f"{words}, turned about {axis}", remedy, _at(parameters, block, turned)))
    motions.append(
        _Motion(
            "all places and lengths larger by one share",
            "one known length: a calibrated bar between two places of the tip, or an instrument with a scale",
            _scaled(model, parameters),
        )
    )
    return motions


def _at(parameters: Parameters, block: str, moved: FloatArray) -> FloatArray:
    """(P,) of displacements (n, 3) of the joints of a block."""
    vector = np.zeros(len(parameters.names))
    own = [k for k, name in enumerate(parameters.names) if name.startswith(f"{block}.")]
    if len(own) == moved.size:
        vector[own] = moved.ravel()
    return vector


def _scaled(model: MachineModel, parameters: Parameters) -> FloatArray:
    """(P,) all places, lengths and gains larger by a thousandth; in the effects' units (um, ppm)."""
    vector = np.zeros(len(parameters.names))
    for k, name in enumerate(parameters.names):
        block = name.split(".")[0]
        if block == "scale_gain":
            vector[k] = 1e3
        elif block in ("base_joint_position", "platform_joint_position", "link_zero", "crank_radius", "tool_offset"):
            vector[k] = parameters.drawing[k]
    return vector


def _members(weights: FloatArray, parameters: Parameters) -> str:
    order = np.argsort(-np.abs(weights))[:_MEMBERS]
    largest = np.abs(weights[order[0]])
    named = [k for k in order if np.abs(weights[k]) >= _MEMBER_SHARE * largest]
    said = [f"{'+' if weights[k] * weights[order[0]] > 0 else '-'} {parameters.elements[k]}" for k in named]
    more = int((np.abs(weights) >= _MEMBER_SHARE * largest).sum()) - len(named)
    return " ".join(said).removeprefix("+ ") + (f" and {more} others" if more > 0 else "")


def _whole(direction: FloatArray, place: IntArray, count: int) -> FloatArray:
    weights = np.zeros(count)
    weights[place] = direction
    return weights
