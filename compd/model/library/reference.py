"""What makes the reference instrument show something else than where the tip is: added to the prediction of what it
shows, x, y, z in mm and the rotation vector in rad. It is no error of the machine and never enters the live loop."""

from __future__ import annotations

from compd.model.effects import Effect, KernelBasis, Parameter
from compd.model.kernels.effects import reference

EFFECTS = (
    Effect(
        id="plate_bending",
        ports=("reference",),
        physics="A plate that is warmer on top bows upwards, so that a tip over its middle stands lower over it.",
        equation="delta_z = -a (T_top - T_bottom) / (2 h) (R^2 - x^2 - y^2)",
        symbols={
            "a": "expansion coefficient of the plate, ppm/K",
            "T_top, T_bottom": "temperatures of the plate's faces, degC",
            "h": "thickness of the plate, mm",
            "R": "radius of the plate points about their centroid, mm",
            "x, y": "the tip in {M}, from that centroid, mm",
        },
        source="Timoshenko, Theory of Plates and Shells (1959), section 14: pure bending by a temperature gradient",
        needs=("temperature_plate_top_degC", "temperature_plate_bottom_degC", "plate_thickness_mm"),
        parameters=(Parameter("a", "ppm/K", 4, 12, "granite 4-8, cast iron 9-12"),),
        mistaken_for=("tool_expansion",),
        separated_by="the middle and the edges of the plate under different gradients",
        basis=KernelBasis(reference.plate_bending),
    ),
    Effect(
        id="reference_drift",
        ports=("reference",),
        physics="The reference instrument's stand creeps.",
        equation="delta = d t",
        symbols={"d": "drift of the instrument along x, y, z, um/h", "t": "time since the recording's start, h"},
        source="ISO 230-3: drift of the measuring set-up itself",
        needs=("time",),
        parameters=(Parameter("d", "um/h", -5, 5, "tripods and magnetic stands after setting up", "axis"),),
        mistaken_for=("link_zero", "link_expansion"),
        separated_by="a fixed target measured again and again; points revisited at other temperatures",
        basis=KernelBasis(reference.drift),
    ),
    Effect(
        id="reference_air_index",
        ports=("reference",),
        physics="An instrument that is not told the air's temperature and pressure takes a wrong wavelength.",
        equation="delta = k (tip - instrument) (-0.93e-6/K dT_room + 0.27e-6/hPa dp)",
        symbols={
            "k": "share that is not compensated: 1 = none is, 1",
            "tip - instrument": "vector from where the beam starts (the origin of {M} unless told) to the tip, mm",
            "dT_room": "room temperature above 20 degC, K",
            "dp": "pressure above 1013.25 hPa, hPa",
        },
        source="Birch and Downs, Metrologia 31 (1994) 315: revised Edlen equation",
        needs=("temperature_room_degC", "pressure_hPa"),
        parameters=(
            Parameter("k", "1", 0, 1.5, "1 = uncompensated air, 0 = compensated; above 1 = wrong sign of a part"),
        ),
        mistaken_for=("scale_gain",),
        separated_by="the same points at two pressures, or a retroreflector at a known distance",
        basis=KernelBasis(reference.air_index),
        counts_from="its own",
    ),
    Effect(
        id="reference_registration",
        ports=("reference",),
        physics="The reference instrument's frame is not {M}.",
        equation="delta = t + w x tip, and w for the attitude",
        symbols={
            "t": "displacement of the frame, um",
            "w": "small rotation of the frame about {M}'s origin, urad",
            "tip": "the tip in {M}, mm",
        },
        source="Spoor and Veldpaus, J. Biomechanics 13 (1980) 391: rigid motion from points",
        needs=(),
        parameters=(
            Parameter("t", "um", -1000, 1000, "what is left when the frames have been laid over one another", "axis"),
            Parameter("w", "urad", -1000, 1000, "what is left when the frames have been laid over one another", "axis"),
        ),
        mistaken_for=(),
        separated_by="three reference marks on the surface plate",
        basis=KernelBasis(reference.registration),
        registration=True,
    ),
)
