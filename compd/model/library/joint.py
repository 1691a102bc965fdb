"""What makes a joint comparator show something else than the joint's motion; added to its reading, in mm."""

from __future__ import annotations

from compd.model.effects import Effect, KernelBasis, Parameter
from compd.model.kernels.effects import joint

EFFECTS = (
    Effect(
        id="joint_comparator_gain",
        ports=("joint",),
        physics="The joint comparators show more or less than their plungers move, by a constant share.",
        equation="delta_k = -k r_k",
        symbols={"k": "gain error, all comparators alike, 1", "r_k": "reading of joint comparator k, mm"},
        source="ISO 13102 (electronic comparators): sensitivity error",
        needs=(),
        parameters=(Parameter("k", "1", -0.2, 0.2, "a lever or conditioner set up wrongly: 20 %"),),
        mistaken_for=("joint_runout",),
        separated_by="a gauge block of known thickness under a comparator",
        basis=KernelBasis(joint.gain),
        follows_reading=True,
    ),
    Effect(
        id="joint_comparator_drift",
        ports=("joint",),
        physics="The comparators' holders grow with temperature and take them away from the balls.",
        equation="delta_k = -c dT_platform",
        symbols={
            "c": "drift, all comparators alike, um/K",
            "dT_platform": "temperature of the platform since machine zero, K",
        },
        source="expansion of a steel holder; Slocum, Precision Machine Design (1992), chapter 6",
        needs=("temperature_platform_degC",),
        parameters=(Parameter("c", "um/K", -0.5, 0.5, "40 mm of steel between ball and plunger: 0.46 um/K"),),
        mistaken_for=("frame_rod_expansion", "platform_expansion"),
        separated_by="warm the platform alone, at places where the links point differently",
        basis=KernelBasis(joint.drift),
    ),
)
