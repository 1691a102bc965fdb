"""What makes a frame comparator show something else than the distance's change; added to its reading, in mm."""

from __future__ import annotations

from compd.model.effects import Effect, KernelBasis, Parameter
from compd.model.kernels.effects import frame

EFFECTS = (
    Effect(
        id="frame_comparator_gain",
        ports=("frame",),
        physics="The frame comparators show more or less than the distances change, by a constant share.",
        equation="delta_k = -k r_k",
        symbols={"k": "gain error, all comparators alike, 1", "r_k": "reading of frame comparator k, mm"},
        source="ISO 13102 (electronic comparators): sensitivity error",
        needs=(),
        parameters=(Parameter("k", "1", -0.05, 0.05, "inductive comparators 0.5-5 % where not adjusted"),),
        mistaken_for=(),
        separated_by="a gauge block of known thickness under a comparator",
        basis=KernelBasis(frame.gain),
        follows_reading=True,
    ),
    Effect(
        id="frame_rod_expansion",
        ports=("frame",),
        physics="The rods that span the frame's nine distances grow with temperature, so that the gauges read short.",
        equation="delta_k = a L_k dT_frame",
        symbols={
            "a": "expansion coefficient of the rods, ppm/K",
            "L_k": "distance k (t1..t3, u1..u6) at machine zero, mm",
            "dT_frame": "temperature of the frame since machine zero, K",
        },
        source="Oiwa, section 3.4: rods of Super-Invar",
        needs=("temperature_frame_degC",),
        parameters=(Parameter("a", "ppm/K", 0, 12, "Super-Invar 0-0.8 (Oiwa, section 2.2), Invar 1.2, steel 11-12"),),
        mistaken_for=("platform_expansion", "joint_comparator_drift"),
        separated_by="warm the frame while the platform keeps its temperature",
        basis=KernelBasis(frame.rod_expansion),
    ),
)
