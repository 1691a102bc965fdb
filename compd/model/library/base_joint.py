"""What takes the centre of a base joint from where the frame measurement has it; added in {M}, in mm."""

from __future__ import annotations

from compd.model.effects import Constant, Effect, KernelBasis, Parameter
from compd.model.kernels.effects import base_joint

EFFECTS = (
    Effect(
        id="base_joint_position",
        ports=("base_joint",),
        physics="A base joint sits elsewhere on its support than the drawing says.",
        equation="delta_i = d_i",
        symbols={"d_i": "displacement of base joint i in {M}, um"},
        source="Wampler, Hollerbach, Arai (1995): kinematic calibration of closed chains",
        needs=(),
        parameters=(Parameter("d", "um", -100, 100, "machining and assembly", "link_axis", tolerance="place"),),
        mistaken_for=("link_zero", "platform_joint_position"),
        separated_by="the whole workspace to its edges; measuring the joints on a coordinate measuring machine",
        basis=KernelBasis(base_joint.position),
    ),
    Effect(
        id="joint_runout",
        ports=("base_joint",),
        physics="A ball that is not round wanders sideways as its joint turns, where no comparator looks.",
        equation="delta_i = e_i (Sp_i sin p_i + Cp_i (cos p_i - z) + Sq_i sin q_i + Cq_i (cos q_i - z))",
        symbols={
            "e_i": "revolute axis of link i in {M}; only motion along it reaches the tip, 1",
            "p_i, q_i": "angles of base joint i since machine zero, towards the axis and across, rad",
            "Sp_i, Cp_i, Sq_i, Cq_i": "runout of ball i with either angle, um",
            "z": "1 where the joints' places were taken at machine zero, the runout there with them; 0 where not, 1",
        },
        source="Oiwa, section 2.1 and reference [3]: motion square to a link changes its length to second order only",
        needs=("revolute_axes",),
        parameters=tuple(
            Parameter(name, "um", -20, 20, "ball bearings 0.05, ground pivots 5, plain joints 20", "link")
            for name in ("Sp", "Cp", "Sq", "Cq")
        ),
        mistaken_for=("tool_offset",),
        separated_by="points in a ring and along a radius: runout follows the joints' angles, an offset does not",
        basis=KernelBasis(base_joint.runout),
        constants=(Constant("z", "1", 0, 1, "how the joints' places were found", (1.0, 0.0)),),
    ),
)
