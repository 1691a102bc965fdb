"""Kernels of the effects at the port `reference`; see `compd.model.library.reference`."""

from __future__ import annotations

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.structures import EffectMachine, EffectRow
from compd.reference_conditions import REFERENCE_PRESSURE_hPa, REFERENCE_TEMPERATURE_degC

PPM = 1e-6
UM = 1e-3  # mm
URAD = 1e-6
HOUR_S = 3600.0

# Refractive index of air near 20 degC, 1013 hPa, 50 %: Edlen's equation as revised by Birch and Downs,
# Metrologia 31 (1994) 315.
INDEX_PPM_PER_K = -0.93
INDEX_PPM_PER_hPa = 0.27


@helper
def plate_bending(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    points = machine.plate_points_M_mm
    middle_x_mm = (points[0, 0] + points[1, 0] + points[2, 0]) / 3
    middle_y_mm = (points[0, 1] + points[1, 1] + points[2, 1]) / 3
    radius_mm2 = 0.0
    for k in range(3):
        radius_mm2 += ((points[k, 0] - middle_x_mm) ** 2 + (points[k, 1] - middle_y_mm) ** 2) / 3
    bow_mm2 = radius_mm2 - (row.tip_M_mm[0] - middle_x_mm) ** 2 - (row.tip_M_mm[1] - middle_y_mm) ** 2
    difference_K = (quantities[0] - quantities[1]) - (quantities[2] - quantities[3])
    basis[2, 0] = -PPM * difference_K / (2 * machine.plate_thickness_mm) * bow_mm2


@helper
def drift(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    for j in range(3):
        basis[j, j] = UM / HOUR_S * row.time_s


@helper
def air_index(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """The instrument's own reference: its tables, or the values typed into it, know nothing of machine zero."""
    warming_K = quantities[0] - REFERENCE_TEMPERATURE_degC
    index = PPM * (INDEX_PPM_PER_K * warming_K + INDEX_PPM_PER_hPa * (quantities[1] - REFERENCE_PRESSURE_hPa))
    for j in range(3):
        basis[j, 0] = (row.tip_M_mm[j] - machine.instrument_M_mm[j]) * index


@helper
def registration(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    constants: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """A small rotation w about the origin of {M} moves the tip by w x tip."""
    x, y, z = row.tip_M_mm[0], row.tip_M_mm[1], row.tip_M_mm[2]
    for j in range(3):
        basis[j, j] = UM
        basis[3 + j, 3 + j] = URAD
    basis[0, 4], basis[0, 5] = URAD * z, -URAD * y
    basis[1, 3], basis[1, 5] = -URAD * z, URAD * x
    basis[2, 3], basis[2, 4] = URAD * y, -URAD * x
