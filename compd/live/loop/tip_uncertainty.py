"""The live tip's standard uncertainty: from the noise of its gauges, as stated or measured, and from the errors of the
fitted numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import GaugeValues
from compd.configuration import Configuration
from compd.live.machine import Beyond, MachineWires
from compd.live.memory import Snapshot
from compd.model import EffectMemory, GaugeNoise, MachineModel, parameter_variance, tip_derivatives
from compd.stated_noise import SCATTER_RATIO
from compd.units import UM_PER_MM

# Number of readings in a length: now and at machine zero.
_READINGS = 2


def stated_noise(configuration: Configuration, wires: MachineWires, readings: int = _READINGS) -> GaugeNoise | None:
    """Of the lengths, which are each the difference of two readings: now and at machine zero.

    At zero many readings are averaged, which makes them no better than one where the last digit stands still. None
    where a length gauge states none, or where nothing is known of a frame that is not measured whole: then the tip's
    uncertainty is not known.

    readings : as of which a length counts; of releases up to 0.2.0, 1.
    """
    lengths_mm = np.array([wire.noise.um * math.sqrt(readings) for wire in wires.length_wires]) / UM_PER_MM
    wiring = configuration.wiring
    drift_um = wiring.unmeasured_frame_um
    if math.isnan(drift_um) or not np.isfinite(lengths_mm).all():
        return None
    quantities = {quantity.name: quantity.noise for quantity in wiring.quantities if quantity.noise}
    return _noise(lengths_mm, wires, quantities, "stated", drift_um / UM_PER_MM)


def noise_now(
    noise: GaugeNoise | None, wires: MachineWires, snapshot: Snapshot, beyond: Beyond | None
) -> GaugeNoise | None:
    """The stated noise; of a length that scatters by far more at rest, its scatter, now and at machine zero.

    beyond : quantities that are taken as the end of the range of the fit: by as much they are off.
    """
    if noise is None:
        return None
    stated_mm, scatter_mm = _lengths_mm(noise), _scatter_mm(noise, wires, snapshot)
    quantities = noise.quantities
    if beyond is not None:
        quantities = {name: math.hypot(sigma, beyond.by.get(name, 0.0)) for name, sigma in quantities.items()}
    return _noise(np.fmax(stated_mm, scatter_mm), wires, quantities, "stated, or measured", noise.frame_drift_mm)


def scatter_limits_mm(noise: GaugeNoise) -> FloatArray:
    """(n + k + 9) scatter of one reading beyond which a length scatters by far more than is stated, mm."""
    return SCATTER_RATIO / math.sqrt(_READINGS) * _lengths_mm(noise)


def _lengths_mm(noise: GaugeNoise) -> FloatArray:
    return np.concatenate([noise.scale_mm, noise.joint_mm, noise.frame_mm])


def _scatter_mm(noise: GaugeNoise, wires: MachineWires, snapshot: Snapshot) -> FloatArray:
    """(n + k + 9) of a length that scatters by far more than is stated, mm; nan of the others."""
    scatter_mm = wires.lengths.scatter_mm(snapshot)
    return np.where(scatter_mm > scatter_limits_mm(noise), scatter_mm * math.sqrt(_READINGS), math.nan)


def _noise(
    lengths_mm: FloatArray, wires: MachineWires, quantities: Mapping[str, float], how: str, frame_drift_mm: float
) -> GaugeNoise:
    links, joints = len(wires.scale.wires), wires.joints
    return GaugeNoise(
        lengths_mm[:links],
        lengths_mm[links : links + joints],
        lengths_mm[links + joints :],
        quantities,
        how,
        frame_drift_mm,
    )


# 95 % quantile of chi-squared over its degrees of freedom, 1, 2 and 3: in between it is below the straight line.
_CHI_SQUARED_95 = (3.8415, 2.9957, 2.6049)


class TipUncertainty(NamedTuple):
    """Of one place of the tip.

    by_noise_um : (4), standard uncertainty along x, y, z of {M}, um, and the radius of the sphere about the tip in
        which it is with 95 %; nan where a fitted number's error or the noise of a needed quantity is not known. None
        where the noise of a gauge is not known.
    tip_by_gauge : (3, n + k + 9), by how much a length moves the tip, mm per mm: scales, joints, frame.
    """

    by_noise_um: FloatArray | None
    tip_by_gauge: FloatArray | None


def has_grown(u: TipUncertainty, noise: GaugeNoise, wires: MachineWires, snapshot: Snapshot) -> bool:
    """Whether the scatter of one length alone moves the tip by more than all noise did when `u` was computed."""
    if u.by_noise_um is None or u.tip_by_gauge is None:
        return False
    tip_mm = np.sqrt((u.tip_by_gauge * u.tip_by_gauge).sum(axis=0)) * _scatter_mm(noise, wires, snapshot)
    return bool((math.sqrt(_CHI_SQUARED_95[-1]) * UM_PER_MM * tip_mm > u.by_noise_um[-1]).any())


def radius_95(covariance: FloatArray) -> float:
    """Radius of the sphere that holds 95 % of a normal distribution with this covariance (3, 3); nan with nan in it.

    The square of the distance is taken for a multiple of a chi-squared variable with the same mean and variance, whose
    degrees of freedom are 1 for a scatter along a line, 3 for an even one (F. E. Satterthwaite, Biometrics Bulletin 2
    (1946) 110-114; so does GUM G.4).
    """
    mean = float(np.trace(covariance))
    if not mean > 0.0:
        return mean
    freedom = mean * mean / float((covariance * covariance).sum())
    return math.sqrt(mean * float(np.interp(freedom, (1.0, 2.0, 3.0), _CHI_SQUARED_95)))


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
    if not len(noise.scale_mm):  # a machine without scales: what its controller drives is taken to be reached
        derivatives = derivatives._replace(by_gauge=derivatives.by_gauge[:, machine.scales :])
    by_gauge_mm = derivatives.by_gauge * _lengths_mm(noise)
    variance = (by_gauge_mm * by_gauge_mm).sum(axis=1) + (derivatives.by_quantity**2).sum(axis=1)
    covariance = by_gauge_mm @ by_gauge_mm.T + derivatives.by_quantity @ derivatives.by_quantity.T
    if machine.live_effects:
        variance += parameter_variance(derivatives.by_theta[None], machine.live_covariance)[0]
        covariance += derivatives.by_theta @ machine.live_covariance @ derivatives.by_theta.T
    if noise.frame_drift_mm:
        variance += noise.frame_drift_mm**2
        covariance += noise.frame_drift_mm**2 * np.eye(3)
    by_noise_um = np.append(np.sqrt(np.maximum(variance, 0.0)), radius_95(covariance)) * UM_PER_MM
    return TipUncertainty(by_noise_um, np.ascontiguousarray(derivatives.by_gauge))
