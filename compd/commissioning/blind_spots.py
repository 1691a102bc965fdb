"""Undetected faults: faults that look like a good machine, the checks that show some of them, and their cost.

The numbers are those of one machine: its kinematics at machine zero, its lines and its limits. `BLIND_SPOTS` is the one
list, for `compd check --what-cannot-be-seen` and for the documentation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.commissioning.jump_trials import FeignedJump, feigned_jumps, measured_lengths
from compd.commissioning.line_budget import LineBudget, line_budgets
from compd.compensation import Compensation, GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.configuration import Configuration
from compd.errors import KinematicsError
from compd.live.acquisition import MIN_MOTION, MIN_WAY_MM, UNIT_LIMITS, WAY_SHARE
from compd.live.machine import RESTED
from compd.machine_builder import build_model
from compd.model import MachineModel
from compd.model.kinematics import ToolOnPlate
from compd.operation_settings import FRAME_DISTANCES
from compd.stated_noise import SCATTER_RATIO, tolerance_mm
from compd.units import UM_PER_MM

DRIFT_UM = 10.0
# Expansion of steel; handbooks have 11 to 12.5.
STEEL_PPM_PER_K = 11.5
# Assumed speed of a machine without a declared one: a measuring machine between two points.
_USUAL_SPEED_MM_PER_S = 50.0
# Motion (mm) of a link at that speed in a gap of 0.2 s.
GAP_WAY_MM = 10.0
_MM_PER_INCH = 25.4


class DriftCost(NamedTuple):
    """Tip error (um) at machine zero of a drift of one length by DRIFT_UM.

    length : as "scale 1". cmm_um : error of the published tip. machine_tool_um : by how much the tip misses its target.
    """

    length: str
    gauge: str
    cmm_um: float
    machine_tool_um: float


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


@dataclass(frozen=True)
class BlindSpot:
    """One kind of fault.

    Attributes
    ----------
    name : stable, for programs.
    fault : what happens.
    shown_by : what shows it, and under which condition; "" if nothing does.
    vote : the key under `votes:` (`VoteSettings`) for this; "" if it needs none, or there is none.
    unseen : what remains that nothing shows.
    cost : its number for a machine; "" if it has none there.
    """

    name: str
    fault: str
    shown_by: str
    vote: str
    unseen: str
    cost: Callable[[Figures], str]


def figures_of(configuration: Configuration) -> Figures:
    """All input of the numbers. Raises KinematicsError for an impossible machine zero."""
    budgets = line_budgets(configuration)
    drifts, exchange_mm = drift_costs(configuration), _exchange_mm(configuration)
    return Figures(configuration, drifts, exchange_mm, feigned_jumps(configuration, budgets), budgets)


def drift_costs(configuration: Configuration) -> list[DriftCost]:
    """Tip error for every length gauge, scales first, then joints and frame: from the kinematics, at machine zero."""
    model = build_model(configuration.geometry, configuration.wiring)
    gauge_of = {length: gauge for gauge, lengths in measured_lengths(configuration).items() for length in lengths}
    lengths = [f"scale {link}" for link in range(1, model.links + 1)]
    lengths += [f"joint {k}" for k in range(1, len(configuration.wiring.joint) + 1)]
    lengths += [f"frame {distance}" for distance in FRAME_DISTANCES]
    drift_mm = DRIFT_UM / UM_PER_MM
    costs = []
    for number, length in enumerate(lengths):
        change_mm = np.zeros(len(lengths))
        change_mm[number] = drift_mm
        costs.append(DriftCost(length, gauge_of[length], *_tip_errors_um(model, change_mm)))
    return costs


def _exchange_mm(configuration: Configuration) -> float:
    """Largest error at the tip for two exchanged scales 1 mm apart."""
    model = build_model(configuration.geometry, configuration.wiring)
    drift_mm = DRIFT_UM / UM_PER_MM
    errors_um = []
    for one, other in combinations(range(model.links), 2):
        change_mm = np.zeros(model.links + len(configuration.wiring.joint) + len(FRAME_DISTANCES))
        change_mm[one], change_mm[other] = drift_mm, -drift_mm
        errors_um.append(_tip_errors_um(model, change_mm)[0])
    return max(errors_um) / DRIFT_UM


def _tip_errors_um(model: MachineModel, change_mm: FloatArray) -> tuple[float, float]:
    """Error at the tip of readings with an error of `change_mm`, in CMM and in machine-tool mode."""
    start = WarmStart.at_zero(model)
    shown, _ = compensate_cmm(model, _values(model, change_mm), start)
    cmm_um = _away_um(model, shown)
    # in machine-tool mode the drive follows the scale setpoint by the wrong scale
    on_plate = isinstance(model.arrangement, ToolOnPlate)
    contact = model.zero.contact
    target_mm = contact.tip_P_mm if on_plate else _in_B0(model, contact.tip_M_mm)
    try:
        command, _ = compensate_machine_tool(model, target_mm, None, _values(model, change_mm), start)
    except KinematicsError:
        return cmm_um, math.nan
    true_scale_mm = command.scale_setpoint_mm - change_mm[: model.links]
    reached, _ = compensate_cmm(
        model, _values(model, np.concatenate([true_scale_mm, 0 * change_mm[model.links :]])), start
    )
    return cmm_um, _away_um(model, reached)


def _away_um(model: MachineModel, computed: Compensation) -> float:
    """Distance of the tip from that at machine zero; on the work with the tool on the plate."""
    contact = model.zero.contact
    if isinstance(model.arrangement, ToolOnPlate):
        return float(np.linalg.norm(computed.tip_P_mm - contact.tip_P_mm) * UM_PER_MM)
    return float(np.linalg.norm(computed.tip_M_mm - contact.tip_M_mm) * UM_PER_MM)


def _in_B0(model: MachineModel, tip_M_mm: FloatArray) -> FloatArray:
    return np.asarray(model.frame.zero_rotation_M_B.T @ (tip_M_mm - model.frame.zero_origin_M_mm))


def _values(model: MachineModel, change_mm: FloatArray) -> GaugeValues:
    n = model.links
    return GaugeValues(change_mm[:n], change_mm[n:-9], change_mm[-9:], {})


def _drift(figures: Figures, kind: str) -> str:
    names = {"scale": "a scale", "joint": "a joint comparator", "frame": "a frame comparator"}
    return f"{DRIFT_UM:g} um of {names[kind]} are up to {figures.largest_um(kind):.1f} um at the tip"


def _stuck_comparator(figures: Figures) -> str:
    silent = [
        gauge
        for gauge in dict.fromkeys(d.gauge for d in figures.drifts if not d.length.startswith("scale"))
        if math.isnan(figures.configuration.noise_of(gauge).um)
    ]
    without = f"; no `noise_um`, so it is unknown: {', '.join(silent)}" if silent else ""
    return f"a joint that moves by {DRIFT_UM:g} um unseen: {figures.largest_um('joint'):.1f} um{without}"


def _stuck_scale(figures: Figures) -> str:
    return f"1 mm of a link unseen is {figures.leverage('scale'):.2f} mm at the tip"


def _exchanged(figures: Figures) -> str:
    return f"two scales 1 mm apart: up to {figures.exchange_mm:.2f} mm at the tip"


def _late(figures: Figures) -> str:
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


def _departure(figures: Figures) -> str:
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


def _small_jump(figures: Figures) -> str:
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


def _lost_periods(figures: Figures) -> str:
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


def _scatter(figures: Figures) -> str:
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


def _power_cut(figures: Figures) -> str:
    configuration = figures.configuration
    counting = [jump.gauge for jump in figures.jumps if not _is_absolute(configuration, jump.gauge)]
    return f"these count from where they are switched on: {', '.join(counting)}" if counting else "all are absolute"


def _is_absolute(configuration: Configuration, gauge: str) -> bool:
    said = configuration.gauges[gauge].absolute
    return configuration.drivers[gauge].absolute if said is None else said


def _wrong_thermometer(figures: Figures) -> str:
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


def shown_by(spot: BlindSpot, configuration: Configuration | None = None) -> str:
    """Checks that show a fault, in words: with the vote for it, and whether that is on in this configuration."""
    if not spot.vote:
        return spot.shown_by or "nothing"
    state = ""
    if configuration is not None:
        setting = getattr(configuration.votes, spot.vote)
        state = " is on" if setting is not None and setting is not False else " is off"
    return f"{spot.shown_by} (`votes.{spot.vote}`{state})"


def _nothing(_figures: Figures) -> str:
    return ""


def _gap(figures: Figures) -> str:
    jumps = [j for j in figures.jumps if any(length.startswith("scale") for length in j.measures)]
    counting = [j.gauge for j in jumps if not _is_absolute(figures.configuration, j.gauge)]
    if not counting:
        return ""
    error_mm = WAY_SHARE * GAP_WAY_MM + MIN_WAY_MM
    return (
        f"in a gap in which the links move by {GAP_WAY_MM:g} mm, {error_mm:.2g} mm of a scale: "
        f"{error_mm * figures.leverage('scale'):.2f} mm at the tip; at rest {_at_rest(figures)}"
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


def _lost_parameters(figures: Figures) -> str:
    factor = figures.leverage("scale")
    return (
        f"for each mm of a link's way from there {2 * factor:.1f} mm at the tip with the other direction, "
        f"{(1 - 1 / _MM_PER_INCH) * factor:.1f} mm in inches"
    )


BLIND_SPOTS: tuple[BlindSpot, ...] = (
    BlindSpot(
        "drift_of_a_scale",
        "a scale drifts: its head comes loose, its mount grows warm",
        "in machine-tool mode, once it exceeds the following error",
        "following_mm",
        "in CMM mode, and where the drive itself follows this scale",
        lambda figures: _drift(figures, "scale"),
    ),
    BlindSpot(
        "drift_of_a_joint_comparator",
        "a joint comparator drifts, or its probe comes loose",
        "of a revolute joint with two: the two no longer go together",
        "joint_pair_um",
        "of a joint with one comparator, or where both drift alike",
        lambda figures: _drift(figures, "joint"),
    ),
    BlindSpot(
        "drift_of_a_frame_comparator",
        "a frame comparator drifts, or its rod grows warm",
        "where frame temperatures are wired: the frame moves more than they explain",
        "frame",
        "slow drifts that a temperature could explain",
        lambda figures: _drift(figures, "frame"),
    ),
    BlindSpot(
        "stuck_comparator",
        "a comparator shows one value for ever: its probe hangs, its unit repeats itself",
        "where its noise exceeds its last digit: bit-identical readings while its neighbours scatter",
        "repeated_digits",
        "where noise or digits are coarse, and until enough readings have come",
        _stuck_comparator,
    ),
    BlindSpot(
        "stuck_scale",
        "a scale shows one value for ever",
        "while the machine moves: the other links, or its own joints, say so",
        "standing_scale_mm",
        "with the machine at rest; and what moved before the vote was sure",
        _stuck_scale,
    ),
    BlindSpot(
        "exchanged_gauges",
        "the cables of two gauges are exchanged, or their ports in the configuration",
        "while they are plugged: each came back with another value, or jumped; in the configuration: the lasting names "
        "of their ports are kept with their last readings and with machine zero",
        "",
        "where both show the same at that moment; and where they were exchanged when machine zero was taken",
        _exchanged,
    ),
    BlindSpot(
        "one_poll_late",
        "a device answers each time with the reading before, or averages",
        "where it can be asked two different things in turn: an answer to the wrong one",
        "",
        "nothing shows a display that is late by itself; at rest it does no harm",
        _late,
    ),
    BlindSpot(
        "departure_from_rest",
        "the machine leaves after a rest",
        "the next reading of its scales; after a short rest, `u_tip_um` allows for it",
        "",
        f"a machine that has rested for {RESTED:g} times as long as its readings are old is taken to rest until then",
        _departure,
    ),
    BlindSpot(
        "small_jump",
        "a reading jumps by less than what its acceleration and noise allow",
        "a larger jump: `acceleration_mm_per_s2` of the gauge",
        "",
        "jumps up to that size",
        _small_jump,
    ),
    BlindSpot(
        "lost_signal_periods",
        "a scale's interpolator loses signal periods, or quarters of them",
        "at rest, while all other lengths stand: two steps or more within an hour that come to a signal period; in "
        "machine-tool mode one step, while its setpoint stands",
        "signal_periods",
        "one step in CMM mode, for which there is a warning; steps of less than a quarter; all that are lost in motion",
        _lost_periods,
    ),
    BlindSpot(
        "scatter",
        "the readings of a length scatter more than its noise: hum, a bad contact, coarse digits",
        f"a warning, where the scatter at rest is over {SCATTER_RATIO:g} times `noise_um`, or less than "
        f"1 / {SCATTER_RATIO:g} of it",
        "",
        "less than that; what comes in motion alone; hum that the polls alias to less than three periods a second; "
        "coarser digits, while the machine stands",
        _scatter,
    ),
    BlindSpot(
        "gauge_that_runs_away",
        "a reading runs away as smoothly as the machine could move",
        "in CMM mode: the tip would be faster than the machine ever is",
        "tip_mm_per_s",
        "in machine-tool mode, and whatever is slower",
        lambda figures: f"1 mm of a scale is {figures.leverage('scale'):.2f} mm at the tip",
    ),
    BlindSpot(
        "wrong_thermometer",
        "a thermometer that an effect reads is wrong: its wire, its module or its place has changed",
        "beyond its range, faster than heat changes anything, or far from most other thermometers "
        "(`plausible`, `fastest_change`, `apart` of the quantity); or the same digits while all others change",
        "standing_temperature_K",
        "what is slower and nearer than that, or nearer when the daemon starts; several alike; one that falls off its "
        "part into air as warm",
        _wrong_thermometer,
    ),
    BlindSpot(
        "power_cut",
        "displays and computer lose their power together; the displays count anew from where they stand",
        "at the start, a gauge that counts must show what it showed last, which is on the disk",
        "",
        "displays that come back with the same number although the machine was moved; a state directory that was lost",
        _power_cut,
    ),
    BlindSpot(
        "display_parameters_at_zero",
        "a scale's display loses its direction or its unit while it shows zero",
        "at any other place: it comes back with another value. At zero a person is asked for, after the computer or "
        "the scale was off",
        "",
        "a person who accepts without a look; a gauge with `absolute` or `trust_after_loss`; comparators, which move "
        "by hundredths of a mm",
        _lost_parameters,
    ),
    BlindSpot(
        "count_lost_in_a_gap",
        "a gauge loses its count while its replies are lost, or it is not read",
        "at rest: it shows another value, and no other gauge has moved. On the move: the ways of the other links, or "
        "its own speed, say where it must be; where they do not, or the gap was longer than `stale_after_s`, a person "
        "is asked for",
        "",
        "what the ways of the links leave open; a comparator on the move, within its limits of motion",
        _gap,
    ),
    BlindSpot(
        "wrong_from_the_start",
        "a sign, a link or a channel is wired wrongly, or machine zero was taken at another place",
        "`compd compare` with a reference instrument; `compd zero` says by how much it differs from the one before",
        "",
        "the daemon alone cannot: at machine zero every wiring shows no change",
        _nothing,
    ),
    BlindSpot(
        "not_measured",
        "what no gauge measures moves: the tool, the plate, a link between scale and joint, the platform",
        "`compd diagnose`, from a recording with a reference instrument",
        "",
        "everything that is not between two ends of a gauge, beyond what the model's effects say",
        _nothing,
    ),
)
