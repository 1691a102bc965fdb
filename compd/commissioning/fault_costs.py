"""Cost of an undetected fault, in words, for one machine: from its kinematics, its lines and its limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from compd.commissioning.drift_costs import DRIFT_UM, DriftCost, drift_costs, exchange_mm
from compd.commissioning.jump_trials import FeignedJump, believed_jump, feigned_jumps
from compd.commissioning.line_budget import LineBudget, line_budgets
from compd.configuration import Configuration
from compd.errors import CompdError
from compd.live.acquisition import MIN_MOTION, UNIT_LIMITS
from compd.machine_builder import build_model
from compd.stated_noise import SCATTER_RATIO, tolerance_mm
from compd.units import UM_PER_MM

# Expansion of steel; handbooks have 11 to 12.5.
STEEL_PPM_PER_K = 11.5
# Assumed speed of a machine without a declared one: a measuring machine between two points.
_USUAL_SPEED_MM_PER_S = 50.0
_MM_PER_INCH = 25.4


@dataclass(frozen=True)
class Figures:
    """Input of the numbers of the blind spots.

    exchange_mm : largest error at the tip where two scales that are 1 mm apart are exchanged.
    """

    configuration: Configuration
    drifts: Sequence[DriftCost]
    exchange_mm: float
    jumps: Sequence[FeignedJump]
    budgets: Sequence[LineBudget]

    def largest_um(self, kind: str) -> float:
        """Largest tip error of a drift of DRIFT_UM among lengths of a kind ("scale", "joint", "frame")."""
        return max((d.cmm_um for d in self.drifts if d.length.startswith(kind)), default=math.nan)

    def leverage(self, kind: str) -> float:
        """Tip error per error of a length."""
        return self.largest_um(kind) / DRIFT_UM


def figures_of(configuration: Configuration) -> Figures:
    """All input of the numbers. Raises KinematicsError for an impossible machine zero."""
    if configuration.external is not None:
        raise CompdError.of(
            configuration.where("geometry"),
            "is of a machine whose lengths compd does not know: what a fault costs at its tip is not known",
            value="machine: external",
            next_step="`compd check` without --what-cannot-be-seen says how far each gauge may jump unseen",
        )
    if not configuration.wiring.scale:
        raise CompdError.of(
            configuration.where("wiring"),
            "has no `scale`: the commanded pose is corrected, and no fault of a scale costs anything",
            next_step="`compd check` without --what-cannot-be-seen says what is not measured",
        )
    budgets = line_budgets(configuration)
    return Figures(
        configuration,
        drift_costs(configuration),
        exchange_mm(configuration),
        feigned_jumps(configuration, budgets),
        budgets,
    )


def drift(figures: Figures, kind: str) -> str:
    names = {"scale": "a scale", "joint": "a joint comparator", "frame": "a frame comparator"}
    return f"{DRIFT_UM:g} um of {names[kind]} are up to {figures.largest_um(kind):.1f} um at the tip"


def stuck_comparator(figures: Figures) -> str:
    silent = [
        gauge
        for gauge in dict.fromkeys(d.gauge for d in figures.drifts if not d.length.startswith("scale"))
        if math.isnan(figures.configuration.noise_of(gauge).um)
    ]
    without = f"; no `noise_um`, so it is unknown: {', '.join(silent)}" if silent else ""
    return f"a joint that moves by {DRIFT_UM:g} um unseen: {figures.largest_um('joint'):.1f} um{without}"


def stuck_scale(figures: Figures) -> str:
    return f"1 mm of a link unseen is {figures.leverage('scale'):.2f} mm at the tip"


def exchanged(figures: Figures) -> str:
    return f"two scales 1 mm apart: up to {figures.exchange_mm:.2f} mm at the tip"


def late(figures: Figures) -> str:
    gauges = figures.configuration.gauges
    late = [
        (jump.quiet.poll_s * (gauges[jump.gauge].fastest_mm_per_s or _USUAL_SPEED_MM_PER_S), jump)
        for jump in figures.jumps
        if any(length.startswith("scale") for length in jump.measures) and math.isfinite(jump.quiet.poll_s)
    ]
    if not late:
        return ""
    late_mm, jump = max(late, key=lambda entry: entry[0])
    error_mm = late_mm * figures.leverage("scale")
    poll_s = jump.quiet.poll_s
    return f"{jump.gauge}, {poll_s * 1e3:.3g} ms late at {late_mm / poll_s:g} mm/s: {error_mm:.2f} mm at the tip"


def departure(figures: Figures) -> str:
    """All links may have left before the next reading, which is requested one poll after the last one."""
    gauges = figures.configuration.gauges
    rounds_s = {budget.name: budget.usual_s for budget in figures.budgets if budget.known}
    scales = [
        j for j in figures.jumps if any(x.startswith("scale") for x in j.measures) and math.isfinite(j.quiet.poll_s)
    ]
    ways = []
    for gauge, poll_s in ((jump.gauge, jump.quiet.poll_s) for jump in scales):
        acceleration = gauges[gauge].acceleration_mm_per_s2
        if acceleration is None:
            return f"no `acceleration_mm_per_s2` of {gauge}, so that nothing limits it"
        unseen_s = poll_s + rounds_s.get(gauges[gauge].line, 0.0)
        ways.append((0.5 * acceleration * unseen_s**2 * UM_PER_MM, unseen_s, gauge))
    if not ways:
        return ""
    way_um, unseen_s, gauge = max(ways)
    tip_um = way_um / DRIFT_UM * sum(d.cmm_um for d in figures.drifts if d.length.startswith("scale"))
    return f"{gauge} in {unseen_s * 1e3:.3g} ms: {way_um:.3g} um; all links at once: up to {tip_um:.3g} um at the tip"


def small_jump(figures: Figures) -> str:
    parts = []
    for kind in ("scale", "joint", "frame"):
        jumps = [j.quiet.jump_mm for j in figures.jumps if any(length.startswith(kind) for length in j.measures)]
        largest_mm = max((jump for jump in jumps if not math.isnan(jump)), default=math.nan)
        if math.isinf(largest_mm):
            parts.append(f"{kind}: any")
        elif math.isfinite(largest_mm):
            jump_um = largest_mm * UM_PER_MM
            parts.append(f"{kind}: {jump_um:.3g} um, {jump_um * figures.leverage(kind):.3g} um at the tip")
    return "; ".join(parts)


def lost_periods(figures: Figures) -> str:
    period_mm = figures.configuration.geometry.scale_signal_period_mm
    if period_mm is None:
        return "no `geometry.scale_signal_period_mm`, so that steps are not summed"
    period_um = period_mm * UM_PER_MM
    one = f"each period of {period_um:g} um that is lost: {period_um * figures.leverage('scale'):.3g} um at the tip"
    jumps = [j.quiet.jump_mm for j in figures.jumps if any(length.startswith("scale") for length in j.measures)]
    largest_mm = max((jump for jump in jumps if math.isfinite(jump)), default=math.nan)
    if math.isnan(largest_mm):
        return one
    largest_um = largest_mm * UM_PER_MM
    return f"{one}; one step at rest: {largest_um:.3g} um, {largest_um * figures.leverage('scale'):.3g} um at the tip"


def scatter(figures: Figures) -> str:
    kinds = {d.gauge: d.length.partition(" ")[0] for d in figures.drifts}
    most_um = {gauge: SCATTER_RATIO * figures.configuration.noise_of(gauge).um for gauge in kinds}
    parts = [
        f"{gauge}: {um:.3g} um, {um * figures.leverage(kinds[gauge]):.3g} um at the tip"
        for gauge, um in most_um.items()
        if not math.isnan(um)
    ]
    silent = [gauge for gauge, um in most_um.items() if math.isnan(um)]
    if silent:
        parts.append(f"no `noise_um`, so that any scatter passes: {', '.join(silent)}")
    return "; ".join(parts)


def power_cut(figures: Figures) -> str:
    configuration = figures.configuration
    counting = [jump.gauge for jump in figures.jumps if not _is_absolute(configuration, jump.gauge)]
    return f"these count from where they are switched on: {', '.join(counting)}" if counting else "all are absolute"


def _is_absolute(configuration: Configuration, gauge: str) -> bool:
    said = configuration.gauges[gauge].absolute
    return configuration.drivers[gauge].absolute if said is None else said


def wrong_thermometer(figures: Figures) -> str:
    """Steel links: errors of a thermometer at one link that stay unseen at once, and for good."""
    configuration = figures.configuration
    length_mm = float(max(build_model(configuration.geometry, configuration.wiring).zero.link_length_mm))
    um_per_K = STEEL_PPM_PER_K * 1e-6 * length_mm * UM_PER_MM * figures.leverage("scale")
    limits = UNIT_LIMITS["degC"]
    return (
        f"with steel links ({STEEL_PPM_PER_K:g} ppm/K), {um_per_K:.1f} um at the tip for each kelvin of a link's "
        f"thermometer: {um_per_K * limits.tolerance:.1f} um at once, {um_per_K * limits.apart:.0f} um as slowly as "
        f"{limits.fastest_per_s:g} K/s; where the model file keeps the range of its fit, no more than that range makes"
    )


def nothing(_figures: Figures) -> str:
    return ""


def gap(figures: Figures) -> str:
    jumps = [j for j in figures.jumps if any(length.startswith("scale") for length in j.measures)]
    counting = [j.gauge for j in jumps if not _is_absolute(figures.configuration, j.gauge)]
    if not counting:
        return ""
    gauges, noise_of = figures.configuration.gauges, figures.configuration.noise_of
    error_mm, gauge = max((believed_jump(gauges[g], gauges[g].restart_s, noise_of(g).um)[1], g) for g in counting)
    if math.isinf(error_mm):
        return f"nothing limits how {gauge} moves; give its `acceleration_mm_per_s2`"
    return (
        f"on the move up to {error_mm:.2g} mm of {gauge} in {gauges[gauge].restart_s:g} s without an answer: "
        f"{error_mm * figures.leverage('scale'):.2g} mm at the tip; at rest {_at_rest(figures)}"
    )


def _at_rest(figures: Figures) -> str:
    """Largest loss of a gauge in a gap at rest, by the kind of the gauge."""
    parts = []
    for kind in ("scale", "joint", "frame"):
        names = {j.gauge.partition(".")[0] for j in figures.jumps if any(x.startswith(kind) for x in j.measures)}
        if names:
            lost_um = (
                MIN_MOTION * max(tolerance_mm(figures.configuration.noise_of(name).um) for name in names) * UM_PER_MM
            )
            parts.append(f"{kind} {lost_um:.3g} um, {lost_um * figures.leverage(kind):.3g} um at the tip")
    return "; ".join(parts)


def lost_parameters(figures: Figures) -> str:
    factor = figures.leverage("scale")
    return (
        f"for each mm of a link's way from there {2 * factor:.1f} mm at the tip with the other direction, "
        f"{(1 - 1 / _MM_PER_INCH) * factor:.1f} mm in inches"
    )
