"""What makes the reference instrument show something else than where the tip is: added to the prediction of what it
shows, x, y, z in mm and the rotation vector in rad. It is no error of the machine and never enters the live loop."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.model.effect import ConstantValues, Effect, Parameter, memoryless_basis
from compd.model.observations import Observations, REFERENCE_PRESSURE_hPa

PPM = 1e-6
UM = 1e-3  # mm
URAD = 1e-6
HOUR_S = 3600.0

# Refractive index of air near 20 degC, 1013 hPa, 50 %: Edlen's equation as revised by Birch and Downs,
# Metrologia 31 (1994) 315.
INDEX_PPM_PER_K = -0.93
INDEX_PPM_PER_hPa = 0.27


def _translation(values: FloatArray) -> FloatArray:
    """(N, 3, P) -> (N, 6, P): no rotation."""
    return np.concatenate([values, np.zeros_like(values)], axis=1)


def _bending(rows: Observations, constants: ConstantValues) -> FloatArray:
    points = rows.constants.plate_points_M_mm
    middle = points.mean(axis=0)
    radius_squared = ((points - middle) ** 2)[:, :2].sum(axis=1).mean()
    from_middle = rows.tip_M_mm - middle
    bow_mm2 = radius_squared - from_middle[:, 0] ** 2 - from_middle[:, 1] ** 2
    difference_K = rows.quantity("temperature_plate_top_degC") - rows.quantity("temperature_plate_bottom_degC")
    z = -PPM * difference_K / (2 * rows.constants.plate_thickness_mm) * bow_mm2
    return _translation(np.stack([np.zeros_like(z), np.zeros_like(z), z], axis=1)[:, :, None])


def _drift(rows: Observations, constants: ConstantValues) -> FloatArray:
    return _translation(UM / HOUR_S * rows.time_s[:, None, None] * np.eye(3))


def _air(rows: Observations, constants: ConstantValues) -> FloatArray:
    pressure_hPa = rows.quantity("pressure_hPa") - REFERENCE_PRESSURE_hPa
    index = PPM * (INDEX_PPM_PER_K * rows.warming_K("room") + INDEX_PPM_PER_hPa * pressure_hPa)
    return _translation(((rows.tip_M_mm - rows.constants.instrument_M_mm) * index[:, None])[:, :, None])


def _registration(rows: Observations, constants: ConstantValues) -> FloatArray:
    basis = np.zeros((len(rows), 6, 6))
    x, y, z = rows.tip_M_mm.T
    basis[:, 0, 0] = basis[:, 1, 1] = basis[:, 2, 2] = UM
    # a small rotation w about the origin of {M} moves the tip by w x tip
    basis[:, 0, 4], basis[:, 0, 5] = URAD * z, -URAD * y
    basis[:, 1, 3], basis[:, 1, 5] = -URAD * z, URAD * x
    basis[:, 2, 3], basis[:, 2, 4] = URAD * y, -URAD * x
    basis[:, 3, 3] = basis[:, 4, 4] = basis[:, 5, 5] = URAD
    return basis


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
        basis=memoryless_basis(_bending),
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
        basis=memoryless_basis(_drift),
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
        basis=memoryless_basis(_air),
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
        basis=memoryless_basis(_registration),
        registration=True,
    ),
)
