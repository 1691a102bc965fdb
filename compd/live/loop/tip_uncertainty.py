"""The live tip's standard uncertainty: from the noise that the configuration declares for its gauges."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import GaugeValues
from compd.configuration import Configuration
from compd.configuration.operation import FRAME_DISTANCES, FrameWire
from compd.model.apply_effects import EffectMemory
from compd.model.machine import MachineModel
from compd.model.observe import Movement, observe
from compd.model.uncertainty import GaugeNoise, tip_uncertainty_mm
from compd.units import UM_PER_MM


def declared_noise(configuration: Configuration) -> GaugeNoise | None:
    """Of every gauge, in the wiring's order; None where a length gauge has none: then the tip's is not known."""
    wiring, gauges = configuration.wiring, configuration.gauges
    frame: dict[str, FrameWire] = {wire.distance: wire for wire in wiring.frame}
    scale = sorted(wiring.scale, key=lambda wire: wire.link)
    found = [
        np.array([gauges[wire.gauge.split(".")[0]].noise_um or math.nan for wire in wires]) / UM_PER_MM
        for wires in (scale, wiring.joint, [frame[distance] for distance in FRAME_DISTANCES])
    ]
    if not all(np.isfinite(sigma_mm).all() for sigma_mm in found):
        return None
    scale_mm, joint_mm, frame_mm = found
    return GaugeNoise(scale_mm, joint_mm, frame_mm, {q.name: q.noise for q in wiring.quantities if q.noise is not None})


def uncertainty_um(
    machine: MachineModel, noise: GaugeNoise, values: GaugeValues, scale_mm: FloatArray, effects: EffectMemory
) -> FloatArray:
    """Of the tip (3) with the scales at scale_mm (n); nan where it is not known, see `tip_uncertainty_mm`."""
    assert machine.constants is not None
    motion = effects.motion
    still = np.zeros((1, machine.links))
    movement = (
        Movement(still, still * math.nan, values.joint_mm[None] * math.nan)
        if motion is None
        else Movement(motion.direction[None], motion.velocity_mm_per_s[None], motion.joint_velocity_mm_per_s[None])
    )
    rows = observe(
        machine,
        machine.constants,
        scale_mm=scale_mm[None],
        joint_mm=values.joint_mm[None],
        frame_mm=values.frame_mm[None],
        quantities={name: np.array([q]) for name, q in values.quantities.items()},
        time_s=np.array([values.time_s]),
        session_start=np.array([False]),
        movement=movement,
    )
    found: FloatArray = tip_uncertainty_mm(machine, rows, noise, effects.memories)[0] * UM_PER_MM
    return found
