"""The bound of the tip's error, `u_tip_um`: with 95 % the tip is no further from where the setpoint says that it is.

It has three parts, which are added (GUM, JCGM 100:2008, F.2.4.5, for what is known and not corrected):

- Noise of the gauges and errors of the fitted numbers: the radius of the sphere in which the tip is with 95 %, by its
  covariance (`compd.live.loop.tip_uncertainty`). The coverage factor of the distance's standard uncertainty is 1.61 for
  an even scatter, and 1.96 for one along a line.
- Age: how far each length may have gone since it was read (`compd.live.machine.wired_readings`), which holds the skew.
  Links move together, so the scales count with the signs that displace the tip most. What joints and frame may do
  they do each by itself: they count as independent, beside the noise.
- What is absent: a correction that fades, is degraded or clamped, or slews to another model, is a displacement of known
  size.

What no gauge measures is not in it, nor what is measured wrongly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import Compensation
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleSettings
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators
from compd.live.loop.tip_uncertainty import TipUncertainty
from compd.live.machine import MachineWires, tip_bound_um
from compd.live.memory import Snapshot
from compd.text import number_text
from compd.units import UM_PER_MM

# Of the causes of a correction, joints and frame come first.
_GAUGED = 2
# From its correction at one limit to that at the other a comparator changes by twice the limit.
_BOTH_SIDES = 2.0


class TipBound(NamedTuple):
    """The bound of one setpoint.

    um : the bound, um; nan where a part is not known.
    lengths_mm : (n + k + 9) by how much each length may be wrong by its age, mm; nan or inf where that is not known.
    absent_um : what is absent, um; nan where that is not known. u : what the noise does.
    """

    um: float
    lengths_mm: FloatArray
    absent_um: float
    u: TipUncertainty


def tip_bound(
    u: TipUncertainty,
    snapshot: Snapshot,
    usable: UsableComparators,
    wanted: Compensation,
    reached_mm: FloatArray,
    target: Target | None,
    settings: CycleSettings,
) -> TipBound | None:
    """The bound of a setpoint; None where the noise of a gauge is not stated.

    wanted : what the gauges ask for. reached_mm : (n), the correction with which the tip of the setpoint is reached.
    """
    by_noise_um, tip_by_gauge = u
    if by_noise_um is None or tip_by_gauge is None:
        return None
    links = len(settings.wires.scale.wires)
    lengths_mm = length_bounds_mm(snapshot, usable, wanted.nominal_scale_mm, settings)
    if target is not None:
        lengths_mm[:links] = 0.0  # the tip is where the target is
    um = tip_bound_um(float(by_noise_um[-1]), tip_by_gauge, lengths_mm, links)
    absent_um = 0.0
    if (absent_mm := _absent_tip_mm(wanted, reached_mm, usable.weight, tip_by_gauge[:, :links], settings)) is not None:
        absent_um += UM_PER_MM * _norm(absent_mm)
    if usable.absent_mm is not None:
        absent_um += UM_PER_MM * _norm(tip_by_gauge[:, links:] @ usable.absent_mm)
    um += absent_um
    return TipBound(um if math.isfinite(um) else math.nan, lengths_mm, absent_um, u)


def with_place(live: ComparatorSet, nominal_scale_mm: FloatArray, settings: CycleSettings) -> ComparatorSet:
    """A live set that knows where the machine was, for the bound while it is held; in part, it does already."""
    return live if settings.noise is None or live.scale_mm else live._replace(scale_mm=tuple(nominal_scale_mm.tolist()))


def _absent_tip_mm(
    wanted: Compensation, reached_mm: FloatArray, weight: float, tip_by_scale: FloatArray, settings: CycleSettings
) -> FloatArray | None:
    """By how much the tip (3) is off since a correction is not reached, by limits and by effects that count less; None
    for none, nan where it is not known.

    weight : by which the corrections of the effects have been multiplied. tip_by_scale : (3, n).
    """
    asked = wanted.pose_correction if settings.corrects_pose else wanted.correction_mm
    assert asked is not None, "without scales the pose is corrected"
    effects_mm = wanted.contributions.by_cause_mm[_GAUGED:]
    less = weight != 1.0 and len(effects_mm) > 0
    if not less and reached_mm is asked:
        return None
    if less and weight == 0.0:
        return np.full(3, math.nan)
    missing_mm = asked - reached_mm
    tip_mm: FloatArray = missing_mm[:3] if settings.corrects_pose else tip_by_scale @ missing_mm
    if not less:
        return tip_mm
    by_effects: FloatArray = effects_mm.sum(axis=0) * ((1.0 - weight) / weight)
    if not (settings.corrects_pose or settings.has_own_pose):
        by_effects = tip_by_scale @ by_effects
    tip_mm += by_effects
    return tip_mm


def length_bounds_mm(
    snapshot: Snapshot, usable: UsableComparators, scale_mm: FloatArray, settings: CycleSettings
) -> FloatArray:
    """(n + k + 9) by how much each length may be wrong by its age, mm; nan or inf where that is not known."""
    wires, links = settings.wires, len(scale_mm)
    largest_mm = _BOTH_SIDES * settings.limits.correction_mm
    bounds_mm, machine_mm_per_s = wires.lengths.age_bound_mm(snapshot, links, settings.loop.extrapolate, largest_mm)
    if usable.held_s is None or usable.comparators is None:
        return bounds_mm
    held_s, held = usable.held_s, usable.comparators
    travel_mm = math.inf
    if held.scale_mm and len(held.scale_mm) == links:
        travel_mm = float(np.abs(scale_mm - held.scale_mm).max()) + machine_mm_per_s * float(held_s.max(initial=0.0))
    drift = np.array(held.drift_mm_per_s) if held.drift_mm_per_s else np.full(len(held_s), math.nan)
    since_mm = np.minimum(0.5 * wires.comparators.acceleration_mm_per_s2 * held_s**2, travel_mm)
    bounds_mm[links:] = np.where(held_s > 0.0, np.minimum(drift * held_s + since_mm, largest_mm), bounds_mm[links:])
    return bounds_mm


def _norm(vector_mm: FloatArray) -> float:
    return math.sqrt(float(vector_mm @ vector_mm))


def refused_bound(
    bound: TipBound | None,
    snapshot: Snapshot,
    usable: UsableComparators,
    needed: tuple[str, ...],
    settings: CycleSettings,
) -> str:
    """Why a setpoint with this bound is refused: the number and what dominates it, or what is not known; "" where it is
    not.

    bound : None where the noise of a gauge is not stated. needed : names of the quantities that the effects need.
    """
    limit_um = settings.limits.tip_error_um
    if limit_um is None or (bound is not None and bound.um <= limit_um):
        return ""
    if bound is None or math.isnan(bound.um):
        return f"the bound of the tip's error is not known (`limits.tip_error_um`): {_unknown(bound, needed, settings)}"
    digits = 3 if number_text(bound.um, "um", 3) != number_text(limit_um, "um", 3) else 6
    may, allowed = (number_text(um, "um", digits) for um in (bound.um, limit_um))
    return (
        f"the tip may be {may} from here, allowed {allowed} (`limits.tip_error_um`): most by "
        f"{_largest_part(bound, snapshot, usable, settings)}"
    )


def _unknown(bound: TipBound | None, needed: tuple[str, ...], settings: CycleSettings) -> str:
    wires = settings.wires
    if bound is None:
        unstated = dict.fromkeys(w.channel.split(".")[0] for w in wires.length_wires if math.isnan(w.noise.um))
        if not unstated:
            return "the frame is not measured whole; state how far that moves the tip, `wiring: frame_drift_um`"
        return f"nobody states how much {_listed(list(unstated))} scatters; give `noise_um` of it under `gauges:`"
    unlimited = [k for k, mm in enumerate(bound.lengths_mm.tolist()) if math.isinf(mm)]
    unmoved = [k for k, mm in enumerate(bound.lengths_mm.tolist()) if math.isnan(mm)]
    if unmoved:
        return f"{_named(wires, unmoved)} has been read only once; how it moves is known with the next reading"
    if unlimited:
        named = _named(wires, unlimited)
        return f"nothing limits how far {named} may have gone; give `acceleration_mm_per_s2` of its gauge"
    if math.isnan(bound.absent_um):
        return "the correction of effects is absent, as a gauge that they need is lost"
    stated = settings.noise.quantities if settings.noise else {}
    if silent := [name for name in needed if name not in stated]:
        return f"nobody states how much {_listed(silent)} scatters; give `noise` of it under `wiring: quantities:`"
    return "the model file does not have the errors of its fitted numbers; fit it again"


def _largest_part(bound: TipBound, snapshot: Snapshot, usable: UsableComparators, settings: CycleSettings) -> str:
    by_length = bound.u.tip_by_gauge
    assert by_length is not None, "a bound that is known has them"
    assert bound.u.by_noise_um is not None, "and the noise"
    parts_um = UM_PER_MM * np.sqrt((by_length**2).sum(axis=0)) * bound.lengths_mm
    noise_um = float(bound.u.by_noise_um[-1])
    largest_um = float(parts_um.max(initial=0.0))  # of a machine without lengths there is none
    if bound.absent_um >= max(noise_um, largest_um):
        return f"what is not corrected, {number_text(bound.absent_um, 'um', 3)}"
    if noise_um >= largest_um:
        noise = number_text(noise_um, "um", 3)
        return f"the scatter of the gauges and the errors of fitted numbers, {noise}; see `noise_um`"
    k = int(np.argmax(parts_um))
    wire = settings.wires.length_wires[k]
    links, age_s = len(settings.wires.scale.wires), snapshot.time_s - snapshot.readings[wire.slot].time_s
    if usable.held_s is not None and k >= links and usable.held_s[k - links] > 0.0:
        return (
            f"{wire.meaning} ({wire.channel}), held since {usable.held_s[k - links]:.2f} s; it is valid when it is back"
        )
    return (
        f"{wire.meaning} ({wire.channel}), {age_s:.3f} s old; it is valid with newer readings, or where it moves less"
    )


def _named(wires: MachineWires, indices: list[int]) -> str:
    return _listed([f"{wires.length_wires[k].meaning} ({wires.length_wires[k].channel})" for k in indices])


def _listed(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
