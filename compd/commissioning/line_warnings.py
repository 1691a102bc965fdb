"""Warnings of `compd check` about overloaded lines, also in the absence of one device."""

from __future__ import annotations

from collections.abc import Sequence

from compd.commissioning.line_budget import LineBudget, gauges_on
from compd.configuration import Configuration
from compd.errors import Problem
from compd.lines import polled_definition

# Largest skew (s) of lengths without a warning, if neither limited nor latched: at 1 mm/s, slow for a moving machine,
# it makes 20 um, and a comparator shows a hundredth of that.
MAX_SPREAD_S = 0.02


def budget_warnings(configuration: Configuration, budgets: Sequence[LineBudget]) -> list[Problem]:
    """Warnings about lines that fail as configured, or in the absence of one device."""
    problems = []
    for budget in budgets:
        stale_after_s = min(
            configuration.gauges[gauge].stale_after_s or configuration.loop.stale_after_s
            for gauge in gauges_on(configuration, budget.name)
        )
        problems += line_warnings(budget, stale_after_s, configuration.where("lines", budget.name))
    return [*problems, *_skew_warnings(configuration, budgets)]


def _skew_warnings(configuration: Configuration, budgets: Sequence[LineBudget]) -> list[Problem]:
    """Lines with a large skew of lengths: beyond `loop.skew_s`, or unnoticed without that limit."""
    allowed_s = configuration.loop.skew_s
    measuring = [budget for budget in budgets if budget.known and _measures_lengths(configuration, budget.name)]
    problems = []
    for budget in measuring:
        # just before its next reading comes, a length is a round older than the newest of another line
        skew_s = max(budget.usual_s, budget.line.poll_every_s)
        if allowed_s is not None and skew_s > allowed_s:
            problems.append(
                Problem(
                    configuration.where("loop", "skew_s"),
                    f"line `{budget.name}` takes {skew_s * 1e3:.0f} ms for a round: setpoints will be refused",
                    value=f"{allowed_s:g} s",
                    allowed=f"{skew_s:.3g} s or more",
                    next_step="raise it, or the baud rate, or spread the gauges over more lines",
                )
            )
        elif allowed_s is None and budget.spread_s > MAX_SPREAD_S:
            problems.append(
                Problem(
                    configuration.where("lines", budget.name),
                    f"its lengths are measured {budget.spread_s * 1e3:.0f} ms apart within a round: on the move "
                    "they do not belong together, and no setpoint is refused for it",
                    allowed=f"{MAX_SPREAD_S * 1e3:g} ms, or a limit",
                    next_step="set `round_trigger` where the devices can latch, or say by `loop.skew_s` how far apart "
                    "lengths may be",
                )
            )
    return problems


def _measures_lengths(configuration: Configuration, line: str) -> bool:
    """Whether a length of the wiring is read on this line."""
    wiring = configuration.wiring
    channels = [
        *(wire.gauge for wire in wiring.scale),
        *(wire.gauge for wire in wiring.joint),
        *(wire.gauge for wire in wiring.frame),
    ]
    return not {channel.split(".")[0] for channel in channels}.isdisjoint(gauges_on(configuration, line))


def line_warnings(budget: LineBudget, stale_after_s: float, where: str) -> list[Problem]:
    """One line's warnings. `stale_after_s`: the shortest of its gauges; `where`: the line's place in the file."""
    if budget.unknown:
        text = f"cannot be planned: {', '.join(budget.unknown)} does not state its bytes per poll"
        return [Problem(where, text, next_step="give the driver `traffic`, or measure with `compd gauge watch`")]
    problems = []
    takes = f"a round of {budget.bytes} bytes takes {budget.usual_s * 1e3:.1f} ms with 10 ms turnaround"
    # A reading is up to a whole round old when the next one comes, and must stay fresh during its reading.
    if 2 * budget.usual_s > stale_after_s:
        problems.append(
            Problem(
                where,
                f"{takes}: readings go stale between two polls",
                value=f"{stale_after_s:g} s until stale",
                allowed=f"{2 * budget.usual_s:.3g} s or more",
                next_step="raise the baud rate, read registers in one block, or spread the gauges over more lines",
            )
        )
    elif budget.line.poll_every_s + budget.usual_s > stale_after_s:
        problems.append(
            Problem(
                where,
                "readings are stale before the next ones come, time and again",
                value=f"poll_every_s {budget.line.poll_every_s:g}, {stale_after_s:g} s until stale",
                allowed=f"poll_every_s below {max(stale_after_s - budget.usual_s, 0.0):.3g} s",
                next_step="in ms? It is in seconds. Poll more often, or raise `stale_after_s` of the line's gauges",
            )
        )
    if budget.line.poll_every_s and budget.usual_s > budget.line.poll_every_s:
        problems.append(
            Problem(
                where,
                f"{takes}: the wanted rate cannot be reached",
                value=f"poll_every_s {budget.line.poll_every_s:g}",
                allowed=f"{budget.usual_s:.3g} s or more",
                next_step="raise poll_every_s, or the baud rate",
            )
        )
    if held_s := polled_definition(budget.line).held_back_s(budget.line):
        held_back_s = budget.usual_s + budget.exchanges * held_s
        problems.append(
            Problem(
                where,
                f"an FTDI adapter holds each reply back for up to 16 ms: a round of {budget.usual_s * 1e3:.1f} ms "
                f"takes up to {held_back_s * 1e3:.1f}",
                value="low_latency: false",
                next_step="leave `low_latency` out",
            )
        )
    if budget.gauges > 1 and budget.usual_s + budget.absent_s > stale_after_s:
        problems.append(
            Problem(
                where,
                f"one absent device of {budget.gauges} delays the others by {budget.absent_s * 1e3:.0f} ms: "
                "they go stale whenever it is tried again",
                value=f"{stale_after_s:g} s until stale",
                next_step="shorten timeout_s, and a gateway's own wait with `gateway_wait_s`, or give that device a "
                "line of its own",
            )
        )
    return problems
