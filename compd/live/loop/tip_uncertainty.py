"""The live tip's standard uncertainty: from the noise that the configuration declares for its gauges, and their age."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation.values import GaugeValues
from compd.configuration import Configuration
from compd.configuration.operation import FRAME_DISTANCES, FrameWire
from compd.model.effect_memory import EffectMemory
from compd.model.machine import MachineModel
from compd.model.tip_derivatives import tip_derivatives
from compd.model.uncertainty import GaugeNoise, parameter_variance
from compd.units import UM_PER_MM


def declared_noise(configuration: Configuration) -> GaugeNoise | None:
    """Of every gauge, in the wiring's order; None where a length gauge declares none: then the tip's is not known."""
    wiring, gauges = configuration.wiring, configuration.gauges
    frame: dict[str, FrameWire] = {wire.distance: wire for wire in wiring.frame}
    scale = sorted(wiring.scale, key=lambda wire: wire.link)
    scale_mm, joint_mm, frame_mm = (
        np.array([gauges[wire.gauge.split(".")[0]].noise_um or math.nan for wire in wires]) / UM_PER_MM
        for wires in (scale, wiring.joint, [frame[distance] for distance in FRAME_DISTANCES])
    )
    if not all(np.isfinite(sigma_mm).all() for sigma_mm in (scale_mm, joint_mm, frame_mm)):
        return None
    quantities = {quantity.name: quantity.noise for quantity in wiring.quantities if quantity.noise is not None}
    return GaugeNoise(scale_mm, joint_mm, frame_mm, quantities, "declared in the configuration")


def with_absent(noise: GaugeNoise | None, absent_mm: FloatArray) -> GaugeNoise | None:
    """The noise with what is absent of the comparators (k + 9) as further uncertainty; None where it is not known."""
    if noise is None or not np.isfinite(absent_mm).all():
        return None
    joints = len(noise.joint_mm)
    return noise._replace(
        joint_mm=np.hypot(noise.joint_mm, absent_mm[:joints]), frame_mm=np.hypot(noise.frame_mm, absent_mm[joints:])
    )


class TipUncertainty(NamedTuple):
    """Of one place of the tip.

    by_noise_um : (3), standard uncertainty without age, um; nan where a fitted number's error or the noise of a needed
        quantity is not known. None where the noise of a gauge is not known.
    tip_by_gauge : (3, n + k + 9), by how much a length moves the tip, mm per mm: scales, joints, frame.
    """

    by_noise_um: FloatArray | None
    tip_by_gauge: FloatArray | None


def with_age(
    by_noise_um: FloatArray | None, tip_by_gauge: FloatArray | None, age_mm: Callable[[], FloatArray]
) -> FloatArray | None:
    """(3,) standard uncertainty of the tip, um, with that of each length by its age; None where there is none.

    Each length has its own age, and they count as independent: so the skew of a setpoint is in it, too.

    by_noise_um, tip_by_gauge : a `TipUncertainty`; without `tip_by_gauge`, in a recording of a release up to 0.2.0,
        age does not count. age_mm : gives that of each length by its age, (n + k + 9), mm.
    """
    if by_noise_um is None or tip_by_gauge is None:
        return by_noise_um
    length_mm = age_mm()
    if not length_mm.any():
        return by_noise_um
    by_age = tip_by_gauge * (UM_PER_MM * length_mm)
    total_um: FloatArray = np.sqrt(by_noise_um * by_noise_um + (by_age * by_age).sum(axis=1))
    return total_um


def tip_uncertainty(
    machine: MachineModel, noise: GaugeNoise | None, values: GaugeValues, scale_mm: FloatArray, effects: EffectMemory
) -> TipUncertainty:
    """Of the tip with the scales at scale_mm (n,); GUM 5.1.2 and 5.2.2, see `compd.model.uncertainty`.

    effects : what they remember after the snapshot.
    """
    if noise is None:
        return TipUncertainty(None, None)
    derivatives = tip_derivatives(
        machine,
        scale_mm=scale_mm,
        joint_mm=values.joint_mm,
        frame_mm=values.frame_mm,
        quantities=values.quantities,
        quantities_at_zero=values.quantities_at_zero,
        sigmas=noise.quantities,
        time_s=float(values.time_s),
        effects=effects,
    )
    by_gauge_mm = derivatives.by_gauge * np.concatenate([noise.scale_mm, noise.joint_mm, noise.frame_mm])
    variance = (by_gauge_mm * by_gauge_mm).sum(axis=1) + (derivatives.by_quantity**2).sum(axis=1)
    if machine.live_effects:
        variance += parameter_variance(derivatives.by_theta[None], machine.live_covariance)[0]
    return TipUncertainty(np.sqrt(np.maximum(variance, 0.0)) * UM_PER_MM, derivatives.by_gauge)
