"""Largest undetected jump of each length gauge, and lines with ambiguous replies.

The limits of a gauge, `acceleration_mm_per_s2` and `fastest_mm_per_s`, say where something can have moved since the
last poll; its noise comes to that (`compd.live.acquisition.possible_motion`). Without limits, any jump is believed that
the next answer confirms.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from compd.commissioning.line_budget import LineBudget
from compd.configuration import Configuration, resolve_channel
from compd.errors import Problem
from compd.gauge import Gauge, GaugeOptions
from compd.line_settings import LineSettings, PushedLineSettings
from compd.lines import definition_of
from compd.live.acquisition import MIN_ROUND_S, MotionLimits, unseen_jump_mm
from compd.pushed_gauge import PushedGauge
from compd.source_time import LATE
from compd.stated_noise import tolerance_mm


def longest_period_s(line: LineSettings, gauge: Gauge[Any]) -> float:
    """The longest time from one value of a gauge to the next, s; nan where the configuration does not say it."""
    if isinstance(line, PushedLineSettings) and line.longest_period_s is not None:
        return line.longest_period_s
    period_s = gauge.period_s if isinstance(gauge, PushedGauge) else None
    return math.nan if period_s is None else period_s


def period_warnings(configuration: Configuration) -> list[Problem]:
    """Gauges whose values become stale before the next one."""
    problems = []
    for name, gauge in configuration.gauge_objects().items():
        options = configuration.gauges[name]
        line = configuration.lines[options.line]
        if not isinstance(line, PushedLineSettings):
            continue
        period_s = longest_period_s(line, gauge)
        stale_after_s = options.stale_after_s or configuration.loop.stale_after_s
        if LATE * period_s > stale_after_s:
            problems.append(
                Problem(
                    configuration.where("gauges", name),
                    f"a new value comes every {period_s:g} s: readings go stale between two of them",
                    value=f"{stale_after_s:g} s until stale",
                    allowed=f"{LATE * period_s:.3g} s or more",
                    next_step=f"let the device send more often and lower `{line.period_key}`, or raise `stale_after_s`",
                )
            )
    return problems


# Delay (s) of the next reading, and perhaps of its sampling, against the plan. Measured on the shipped tripod,
# simulated, on two processors: quiet, by the jumps that were believed at load 1.2 (25 um of a joint); with other
# processes on both processors all the time, 99.9 % of the readings.
LATE_S, LATE_BUSY_S = 0.015, 0.08


class BelievedJump(NamedTuple):
    """poll_s : interval of readings including delays, s. jump_mm : the largest jump that is accepted then."""

    poll_s: float
    jump_mm: float


class FeignedJump(NamedTuple):
    """Largest undetected jump of one gauge.

    gauge : its name. measures : what its channels measure, as "scale 1". quiet, busy : the largest jumps of a part at
    rest on a computer that does nothing else, and with four busy processes: inf without a limit, nan where the driver
    does not say what it moves.
    """

    gauge: str
    measures: tuple[str, ...]
    quiet: BelievedJump
    busy: BelievedJump


def feigned_jumps(configuration: Configuration, budgets: Sequence[LineBudget]) -> list[FeignedJump]:
    """Largest undetected jumps of all length gauges, in the order of the file."""
    poll_s = {budget.name: _poll_s(budget) for budget in budgets}
    gauges = configuration.gauge_objects()
    measures = measured_lengths(configuration)
    return [
        _jump(
            gauge,
            measures[gauge],
            poll_s.get(options.line, longest_period_s(configuration.lines[options.line], gauges[gauge])),
            options,
            configuration.noise_of(gauge).um,
        )
        for gauge, options in configuration.gauges.items()
        if gauge in measures
    ]


def measured_lengths(configuration: Configuration) -> dict[str, tuple[str, ...]]:
    """Lengths measured by each gauge ("scale 1", "joint 3", "frame u1"), in the order of its channels."""
    wiring = configuration.wiring
    wires = [(f"scale {wire.link}", wire.gauge) for wire in wiring.scale]
    wires += [(f"joint {k}", wire.gauge) for k, wire in enumerate(wiring.joint, start=1)]
    wires += [(f"frame {wire.distance}", wire.gauge) for wire in wiring.frame]
    measures: dict[str, list[tuple[int, str]]] = {}
    for meaning, reference in wires:
        channel = resolve_channel(reference, configuration.gauges, configuration.drivers)
        assert channel is not None, f"{reference} was checked when the configuration was loaded"
        gauge, _, name = channel.partition(".")
        names = [c.name for c in configuration.drivers[gauge](configuration.gauges[gauge]).channels]
        measures.setdefault(gauge, []).append((names.index(name), meaning))
    return {gauge: tuple(meaning for _, meaning in sorted(named)) for gauge, named in measures.items()}


def jump_warnings(configuration: Configuration, jumps: Sequence[FeignedJump]) -> list[Problem]:
    """Warnings about a gauge without a limit, or with a nearly ineffective one."""
    largest_mm = configuration.limits.correction_mm
    warnings = []
    for jump in jumps:
        poll_s, jump_mm = jump.quiet
        if math.isinf(jump_mm):
            warnings.append(
                Problem(
                    configuration.where("gauges", jump.gauge),
                    f"any jump of {named_together(jump.measures)} is accepted once two polls agree",
                    next_step="write `acceleration_mm_per_s2:`, the largest acceleration of what it measures",
                )
            )
        elif jump_mm > largest_mm:
            warnings.append(
                Problem(
                    configuration.where("gauges", jump.gauge),
                    f"a jump of {named_together(jump.measures)} of {jump_mm:.3g} mm is believed",
                    value=f"{_limits_text(configuration.gauges[jump.gauge])}, read every {poll_s * 1e3:.3g} ms",
                    allowed=f"what is believed should be below limits.correction_mm, {largest_mm:g} mm",
                    next_step="write `acceleration_mm_per_s2:` as small as it really is, or poll it more often",
                )
            )
    return warnings


def reply_warnings(configuration: Configuration) -> list[Problem]:
    """Lines of several gauges on which a late reply looks like the answer to the next request."""
    gauges = configuration.gauge_objects()
    return [
        Problem(
            configuration.where("lines", line),
            f"replies on this line are anonymous: one of {named_together(unnamed)} that comes late "
            "looks like the answer of another gauge, and costs a pause until the line is in step again",
            next_step="let replies carry an address (see `compd gauge show DRIVER`), or give each gauge a line",
        )
        for line, settings in configuration.lines.items()
        if definition_of(settings).carries == "bytes"
        and (
            unnamed := _without_identity(
                {name: gauges[name].reply_identity for name, on in configuration.gauges.items() if on.line == line}
            )
        )
    ]


def named_together(names: Sequence[str]) -> str:
    """("joint 1", ..., "joint 9", "scale 2") -> "joint 1 to 9, scale 2"."""
    return ", ".join(_runs(names))


def _runs(names: Sequence[str]) -> Iterator[str]:
    start = 0
    for i in range(1, len(names) + 1):
        if i < len(names) and _follows(names[i - 1], names[i]):
            continue
        first, last = names[start], names[i - 1]
        if i - start > 2:
            yield f"{first} to {last.rpartition(' ')[2]}"
        else:
            yield from names[start:i]
        start = i


def _follows(before: str, name: str) -> bool:
    """Whether one name counts on from the other: "joint 3" after "joint 2", "frame u2" after "frame u1"."""
    kind, _, number = before.rpartition(" ")
    letter, digits = number.rstrip("0123456789"), number[len(number.rstrip("0123456789")) :]
    return digits.isdigit() and name == f"{kind} {letter}{int(digits) + 1}"


def _limits_text(options: GaugeOptions) -> str:
    limits = {"mm/s2": options.acceleration_mm_per_s2, "mm/s": options.fastest_mm_per_s}
    return ", ".join(f"{limit:g} {unit}" for unit, limit in limits.items() if limit is not None)


def _without_identity(identities: Mapping[str, str | None]) -> list[str]:
    """Gauges of one line whose replies are ambiguous."""
    counts = Counter(identities.values())
    unnamed = [gauge for gauge, identity in identities.items() if identity is None or counts[identity] > 1]
    return unnamed if len(identities) > 1 else []


def _poll_s(budget: LineBudget) -> float:
    return max(budget.usual_s, budget.line.poll_every_s, MIN_ROUND_S) if budget.known else math.nan


def _jump(gauge: str, measures: tuple[str, ...], poll_s: float, options: GaugeOptions, noise_um: float) -> FeignedJump:
    usual, busy = (believed_jump(options, poll_s + late_s, noise_um) for late_s in (LATE_S, LATE_BUSY_S))
    return FeignedJump(gauge, measures, usual, busy)


def believed_jump(options: GaugeOptions, poll_s: float, noise_um: float) -> BelievedJump:
    """The largest accepted jump of a gauge with these limits and noise, with `poll_s` between two readings."""
    speed, acceleration = options.fastest_mm_per_s or math.inf, options.acceleration_mm_per_s2 or math.inf
    limits = MotionLimits(speed, acceleration)
    unlimited = math.isinf(speed) and math.isinf(acceleration)
    jump_mm = math.inf if unlimited else unseen_jump_mm(limits, poll_s, tolerance_mm(noise_um))
    return BelievedJump(poll_s, jump_mm)
