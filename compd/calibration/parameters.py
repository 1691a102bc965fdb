"""The numbers of a machine that a calibration may change: blocks of the library's geometric effects.

A block is one effect: places of the base joints, zeros of the links, gains of the scales. Its numbers are what the
effect fits, its tolerance is the plausible range that `compd.parameter_ranges` gives on the machine, so that
`geometry.tolerance_mm` and stated ranges count here as they do in a diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.model import MachineModel
from compd.model.effects import Effect, FittedEffect, Observations, evaluate_basis, unmet_needs
from compd.model.library import DRAWN, load_library
from compd.parameter_ranges import StatedRange, on_machine
from compd.units import UM_PER_MM

# Effects of the drawing in the order in which they are tried, with the words of a report.
WORDS: Mapping[str, str] = {
    "link_zero": "lengths of the links",
    "actuator_zero": "zeros of the actuators",
    "scale_gain": "gains of the scales",
    "base_joint_position": "places of the base joints",
    "platform_joint_position": "places of the platform joints",
    "actuator_direction": "directions of the actuators",
    "crank_radius": "radii of the cranks",
    "revolute_axis_tilt": "directions of the hinges, about the third axis",
    "hinge_inclination": "directions of the hinges, towards the third axis",
    "tool_offset": "the place of the tip",
    "scale_gain_change": "gains that change with the reading",
}
# Effects of another form than a drawing's: its numbers and their tolerance say nothing of them.
NOT_DRAWN = frozenset({"scale_gain_change"})


class Block(NamedTuple):
    """One effect of the drawing on one machine.

    effect : with its ranges on the machine.  used : (P,) numbers that move anything; the others stay 0.
    """

    effect: Effect
    used: BoolArray

    @property
    def words(self) -> str:
        """What it is, in a report."""
        return WORDS.get(self.effect.id, self.effect.id)

    @property
    def drawn(self) -> bool:
        """Whether a drawing states these numbers, as places or lengths or as perfect, with a tolerance."""
        return self.effect.id not in NOT_DRAWN

    def fitted(self, theta: FloatArray, covariance: FloatArray) -> FittedEffect:
        """The effect with the numbers in use (U,) and their covariance (U, U), the others 0 and known."""
        whole, place = np.zeros(len(self.used)), np.flatnonzero(self.used)
        whole[place] = theta
        joint = np.zeros((len(whole), len(whole)))
        joint[np.ix_(place, place)] = covariance
        return FittedEffect(self.effect, whole, {}, joint)


class Parameters(NamedTuple):
    """All numbers that may change, P of them, in the order of the blocks.

    names : "base_joint_position.d_3x".  elements : "rod 3 base x".  units : in which people read them.
    per_theta : (P,) one unit of the effect's number in `units`: 0.001 mm of a um.  drawing : (P,) in `units`.
    prior_std : (P,) of the effect's numbers, in the effect's unit: the tolerance.  block_of : (P,), the place in
    `blocks`.
    """

    blocks: tuple[Block, ...]
    names: tuple[str, ...]
    elements: tuple[str, ...]
    units: tuple[str, ...]
    per_theta: FloatArray
    drawing: FloatArray
    prior_std: FloatArray
    block_of: IntArray

    def split(self, theta: FloatArray, covariance: FloatArray, blocks: Sequence[int]) -> tuple[FittedEffect, ...]:
        """These blocks as effects of a model, from numbers (P,) and covariance (P, P) of all."""
        of = [np.flatnonzero(self.block_of == block) for block in blocks]
        return tuple(
            self.blocks[block].fitted(theta[own], covariance[np.ix_(own, own)])
            for block, own in zip(blocks, of, strict=True)
        )


def calibration_parameters(
    model: MachineModel,
    rows: Observations,
    ranges: Sequence[StatedRange] = (),
    without: Sequence[str] = (),
) -> Parameters:
    """The numbers of this machine's drawing that rows can tell anything of.

    rows : poses with their gauges, of one or several recordings; a gain's tolerance follows from their stroke where the
        configuration states none.  ranges : stated for single parameters.  without : ids of effects to leave out.
    """
    library = {**load_library(), **{effect.id: effect for effect in DRAWN}}
    blocks = []
    for name in WORDS:
        effect = on_machine(library[name], rows, ranges)
        if name in without or unmet_needs(effect, rows.available, rows.links, rows.quantities_at_zero):
            continue
        basis, _ = evaluate_basis(effect, rows, {}, None)
        used = np.asarray((np.nan_to_num(basis) != 0).any(axis=(0, 1))) & _stated(model, name)(len(basis[0, 0]))
        if used.any():
            blocks.append(Block(effect, used))
    names, elements, units, per_theta, drawing, prior, block_of = [], [], [], [], [], [], []
    for number, block in enumerate(blocks):
        said, drawn_mm = _drawn(model, block.effect.id)
        for place in np.flatnonzero(block.used).tolist():
            column = block.effect.columns(rows.links)[place]
            names.append(f"{block.effect.id}.{column.name}")
            elements.append(said[place])
            in_mm = column.parameter.unit == "um"
            units.append("mm" if in_mm else column.parameter.unit)
            per_theta.append(1 / UM_PER_MM if in_mm else 1.0)
            drawing.append(drawn_mm[place])
            low, high = column.parameter.theta_range
            prior.append((high - low) / 2)
            block_of.append(number)
    return Parameters(
        tuple(blocks),
        tuple(names),
        tuple(elements),
        tuple(units),
        np.array(per_theta),
        np.array(drawing),
        np.array(prior),
        np.array(block_of, dtype=np.int64),
    )


def _stated(model: MachineModel, name: str) -> Callable[[int], BoolArray]:
    """Which of an effect's numbers the drawing has: the zero of an actuator that extends is its link's length."""
    if name == "actuator_zero":
        return lambda count: np.asarray(model.actuators.kinds != 0)[:count]
    return lambda count: np.ones(count, dtype=bool)


def _drawn(model: MachineModel, name: str) -> tuple[list[str], list[float]]:
    """Element in words and the drawing's number (mm, else 0) of each number of an effect."""
    n, m, zero = model.links, model.scales, model.zero
    rods, scales = range(1, n + 1), range(1, m + 1)
    if name == "link_zero":
        return [f"rod {i} length" for i in rods], zero.link_length_mm.tolist()
    if name == "actuator_zero":
        return [f"actuator {i} zero" for i in scales], zero.actuator_mm.tolist()
    if name in ("base_joint_position", "platform_joint_position"):
        end = "base" if name == "base_joint_position" else "platform"
        joints_mm = model.base_joints_at_0_M_mm if end == "base" else model.platform_joints_P_mm
        return [f"rod {i} {end} {axis}" for i in rods for axis in "xyz"], np.ravel(joints_mm).tolist()
    if name == "crank_radius":
        return [f"actuator {i} radius" for i in scales], model.actuators.radius_mm.tolist()
    if name == "actuator_direction":
        return [f"actuator {i} direction {which}" for which in "ab" for i in scales], [0.0] * (2 * m)
    if name == "tool_offset":
        return [f"tip {axis}" for axis in "xyz"], model.arrangement.tool_mm.tolist()
    if name in ("revolute_axis_tilt", "hinge_inclination"):
        how = "about z" if name == "revolute_axis_tilt" else "towards z"
        return [f"hinge {i} {how}" for i in rods], [0.0] * n
    what = "gain" if name == "scale_gain" else "gain change"
    return [f"actuator {i} {what}" for i in scales], [0.0] * m
