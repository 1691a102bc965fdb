"""Strengths of the simulated machine's ordinary error sources, with unit and origin of each value."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace


@dataclass(frozen=True)
class Strengths:
    """One number per error source. Zero removes it; `NOTHING` is the ideal machine.

    Expansion coefficients are handbook values at 20 degC; the others are typical of a small
    coordinate measuring machine, with the reason beside each.
    """

    # Weather: daily swing of an air-conditioned laboratory, about 1 K (VDI/VDE 2627, class 3).
    room_swing_K: float = 1.0
    # Heat of drives and electronics, as a multiple of the watts in warm_up.py.
    heat_share: float = 1.0

    # Frame: grey cast iron 10-11.5 ppm/K; low-expansion cast iron, the paper's joint supports, 2-3 ppm/K.
    column_expansion_ppm_per_K: float = 11.0
    ring_expansion_ppm_per_K: float = 11.0
    support_expansion_ppm_per_K: float = 2.5
    # Granite 4-8 ppm/K.
    plate_expansion_ppm_per_K: float = 6.0
    # A welded or cast column of this size takes 100-200 N/um along and ten times less across.
    column_give_along_um_per_N: float = 0.007
    column_give_across_um_per_N: float = 0.05

    # Rods: Super-Invar 0.3-0.8 ppm/K (paper, section 2.2).
    frame_rod_expansion_ppm_per_K: float = 0.5
    scale_rod_expansion_ppm_per_K: float = 0.5

    # Platform of low-expansion cast iron; stylus stem of tungsten carbide, 5 ppm/K.
    platform_expansion_ppm_per_K: float = 2.5
    tool_expansion_ppm_per_K: float = 5.0

    # Ball joints: eccentricity of ball and socket; over the few degrees that a joint turns, the ball's
    # centre then wanders by several um, as the paper's comparators saw. The preload seats the ball, so
    # that it wanders less across the link than along it.
    ball_runout_um: float = 40.0
    ball_runout_across_share: float = 0.025
    # A preloaded ball of 25 mm: 50-100 N/um along the link, less across.
    ball_give_along_um_per_N: float = 0.015
    ball_give_across_um_per_N: float = 0.004

    # The two reference balls of a revolute joint's shank are ground eccentric, in opposite directions:
    # that is why the paper takes the mean of Ra and Rb.
    shank_eccentricity_um: float = 6.0
    # Noise and step of an inductive comparator.
    comparator_noise_um: float = 0.02
    comparator_step_um: float = 0.01
    # Interpolation noise of a grating scale of 20 um period.
    scale_noise_um: float = 0.005
    thermometer_noise_K: float = 0.01


NOTHING = Strengths(**{field.name: 0.0 for field in fields(Strengths)})

# A machine whose errors the gauges measure completely: joints move along the links only, and rods and platform do not
# expand. A hidden cause is then the only error that the gauges do not measure.
FULLY_MEASURED = replace(
    Strengths(),
    ball_runout_across_share=0.0,
    ball_give_across_um_per_N=0.0,
    support_expansion_ppm_per_K=0.0,
    plate_expansion_ppm_per_K=0.0,
    frame_rod_expansion_ppm_per_K=0.0,
    scale_rod_expansion_ppm_per_K=0.0,
    platform_expansion_ppm_per_K=0.0,
    tool_expansion_ppm_per_K=0.0,
)
WITHOUT_NOISE = {
    "comparator_noise_um": 0.0,
    "comparator_step_um": 0.0,
    "scale_noise_um": 0.0,
    "thermometer_noise_K": 0.0,
}
FULLY_MEASURED_WITHOUT_NOISE = replace(FULLY_MEASURED, **WITHOUT_NOISE)


def seen_by(strengths: Strengths, joints: int) -> Strengths:
    """These errors without those of the joints where none of so many comparators measures them."""
    unseen = {"ball_runout_um": 0.0, "ball_give_along_um_per_N": 0.0, "shank_eccentricity_um": 0.0}
    return strengths if joints else replace(strengths, **unseen)
