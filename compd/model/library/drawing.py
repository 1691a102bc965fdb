"""Numbers of a drawing that only a calibration fits: as causes of an error they look like others of the library.

`DRAWN` are no candidates of a diagnosis. A model file names them by their ids, as all effects.
"""

from __future__ import annotations

from compd.model.effects import Effect, KernelBasis, Parameter
from compd.model.kernels.effects import drawing

_SOURCE = "Wampler, Hollerbach, Arai (1995): kinematic calibration of closed chains"

DRAWN = (
    Effect(
        id="actuator_zero",
        ports=("scale",),
        physics="An actuator that slides or turns stands elsewhere at machine zero than the drawing says.",
        equation="delta_i = z_i",
        symbols={"z_i": "error of actuator i's place at machine zero, um; of a turning one um of arc"},
        source=_SOURCE,
        needs=("scale",),
        parameters=(Parameter("z", "um", -50, 50, "adjustment of machine zero", "scale", tolerance="place"),),
        mistaken_for=("link_zero", "base_joint_position"),
        separated_by="the whole workspace to its edges",
        basis=KernelBasis(drawing.actuator_zero),
    ),
    Effect(
        id="scale_gain_change",
        ports=("scale",),
        physics="A scale's gain changes with its reading, as that of a spool on which a line winds in layers.",
        equation="delta_i = c_i g_i^2",
        symbols={"c_i": "change of the gain of scale i, ppm/mm", "g_i": "reading of scale i, mm"},
        source="second term of the series of a reading's error; Slocum, Precision Machine Design (1992), chapter 4",
        needs=("scale",),
        parameters=(
            Parameter("c", "ppm/mm", -0.5, 0.5, "50 ppm over 100 mm of a steel tape", "scale", tolerance="gain_change"),
        ),
        mistaken_for=("scale_gain", "link_sag"),
        separated_by="readings at both ends of the stroke and in the middle",
        basis=KernelBasis(drawing.gain_change),
        intercept="scale_gain",
    ),
    Effect(
        id="actuator_direction",
        ports=("base_joint",),
        physics="A rail, or the plane of a crank, is inclined against the drawing.",
        equation="slides: delta_i = q (a_s f + b_s g); turns: delta_i = r (a_s sin(q/r) - b_s cos(q/r)) n",
        symbols={
            "a_s, b_s": "inclinations of the actuator s of link i: of a rail towards f and g, of a circle about its "
            "cosine and its sine axis, urad",
            "q": "where the actuator stands, mm",
            "f, g": "unit vectors square to the rail: the axis of {M} that is farthest from it, made square, and the "
            "rail crossed with that",
            "r, n": "radius of the circle, mm, and its normal",
        },
        source=_SOURCE,
        needs=("scale",),
        parameters=tuple(
            Parameter(name, "urad", -500, 500, "50 um over 100 mm", "scale", tolerance="tilt") for name in ("a", "b")
        ),
        mistaken_for=("base_joint_position",),
        separated_by="the whole workspace to its edges",
        basis=KernelBasis(drawing.actuator_direction),
    ),
    Effect(
        id="crank_radius",
        ports=("base_joint",),
        physics="A crank is longer or shorter than the drawing says.",
        equation="delta_i = d_s (cos f u + sin f v - f (cos f v - sin f u)), f = q/r",
        symbols={
            "d_s": "error of the radius of the crank s of link i, um; what its scale shows stays mm of arc",
            "q, r": "where the actuator stands, mm of arc, and the drawn radius, mm",
            "u, v": "cosine and sine axis of the circle",
        },
        source=_SOURCE,
        needs=("scale",),
        parameters=(Parameter("d", "um", -100, 100, "machining and assembly", "scale", tolerance="place"),),
        mistaken_for=("base_joint_position", "actuator_zero"),
        separated_by="the whole workspace to its edges",
        basis=KernelBasis(drawing.crank_radius),
    ),
    Effect(
        id="hinge_inclination",
        ports=("revolute_axis",),
        physics="The axes of hinges leave the plane square to the third axis of what carries them.",
        equation="delta e_i = v_i (z - (z . e_i) e_i)",
        symbols={
            "v_i": "angle by which axis i is inclined towards z, urad",
            "z": "third axis of {P}, or of {M} where the base carries the hinge, 1",
        },
        source=_SOURCE,
        needs=("revolute_axes",),
        parameters=(Parameter("v", "urad", -500, 500, "20 um over 40 mm of a hinge", "link", tolerance="tilt"),),
        mistaken_for=("revolute_axis_tilt", "base_joint_position"),
        separated_by="the edges of the workspace",
        basis=KernelBasis(drawing.hinge_inclination),
    ),
)
