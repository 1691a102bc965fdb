"""What must hold in every world: each a function that says what does not hold, and "" where it holds.

Of each setpoint: `within_bound`, `steady_correction`, `true_reason`. Of a world between two of its events:
`nothing_lost`; of its models: `adopted_model`; of its controller: `fresh_target`; of its clients: `nobody_waits`; of a
whole world: `mostly_valid`. `tests.worlds.recovery` has the times after faults, and `tests.worlds.run` sees tracebacks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set

import numpy as np

from compd.configuration import Configuration
from compd.live.loop import Setpoint
from compd.setpoint_states import Mode, State
from tests.worlds.coverage import Coverage
from tests.worlds.sight import Sight

# A valid setpoint may be wrong by so many times its bound.
MOST = 3.0
# Share of valid setpoints in a world without faults.
VALID_SHARE = 0.99
# Longest time between two setpoints at a client that wants 20 a second, s.
HEARS_WITHIN_S = 0.15
# Rounding of a correction and of a time, mm and s.
_ROUNDING_MM, _ROUNDING_S = 1e-9, 1e-6

Invariant = Callable[[Sight], str]


def within_bound(sight: Sight) -> str:
    """No valid setpoint is beyond three times its bound, without what no data can show (`tests.worlds.unknowable`)."""
    told, bound_um = sight.told, sight.bound_um
    if not told.valid or not sight.left_um > MOST * bound_um:
        return ""
    part = "" if sight.left_um == told.error_um else f", {sight.left_um:.4g} um of it could be known,"
    return f"{told.error_um:.4g} um{part} of a bound of {bound_um:.4g} um while {told.state}"


def steady_correction(sight: Sight) -> str:
    """A correction changes no faster than `limits.slew_mm_per_s`, whatever is adopted, reloaded or accepted."""
    before, now = sight.before, sight.setpoint
    if before is None or before.values is None or now.values is None:
        return ""
    passed_s = max(now.time_s - before.time_s, 1.0 / sight.configuration.loop.rate_hz) + _ROUNDING_S
    allowed_mm = sight.configuration.limits.slew_mm_per_s * passed_s + _ROUNDING_MM
    changes_mm = np.abs(now.values.correction_mm - before.values.correction_mm)
    if not changes_mm.size or not (largest_mm := float(changes_mm.max())) > allowed_mm:
        return ""
    return f"a correction changed by {largest_mm:.6g} mm in {passed_s:.4g} s; allowed {allowed_mm:.4g} mm"


def true_reason(sight: Sight) -> str:
    """A reason that asks a person to look at gauges names at least one that had a fault since a person last looked."""
    told = sight.told
    if told.state is not State.FAULT or "" in sight.suspects:
        return ""
    named = named_in(told.reason, sight.configuration)
    if not named or named & sight.suspects:
        return ""
    return f"names {', '.join(sorted(named))}, none of which had a fault: {told.reason[:200]}"


def named_in(reason: str, configuration: Configuration) -> set[str]:
    """Gauges that a reason names, as words of their own."""
    words = set("".join(c if c.isalnum() or c == "_" else " " for c in reason).split())
    return words & set(configuration.gauges)


OF_SETPOINTS: Mapping[str, Invariant] = {
    invariant.__name__: invariant for invariant in (within_bound, steady_correction, true_reason)
}


def nothing_lost(taken: Mapping[str, float], used: Mapping[str, float]) -> str:
    """The machine zero that a person took last is used, whatever was killed, restarted or reloaded since.

    taken, used : readings at machine zero by channel, mm.
    """
    if taken == used:
        return ""
    channels = sorted(name for name in {*taken, *used} if taken.get(name) != used.get(name))
    return f"machine zero of {len(channels)} channels is not the one that was taken last: {', '.join(channels[:5])}"


def adopted_model(allowed: Set[str], used: str) -> str:
    """The model that was adopted is the one that runs, also after the loop or its service was killed.

    allowed : hashes of what was promised last and of what was asked for since. used : hash that a setpoint names.
    """
    if used in allowed:
        return ""
    return f"runs with the model {used or 'none'}; promised was {' or '.join(sorted(one or 'none' for one in allowed))}"


def fresh_target(setpoint: Setpoint, target_s: float, valid_for_s: float) -> str:
    """No valid setpoint in machine-tool mode is for a target that is too old (docs/reference/protocol.md).

    target_s : time of the newest target that the controller has sent, s. valid_for_s : `sockets.target.valid_for_s`.
    """
    age_s = setpoint.time_s - target_s
    if not setpoint.valid or setpoint.mode is not Mode.MACHINE_TOOL or age_s <= valid_for_s + _ROUNDING_S:
        return ""
    return f"valid for a target of {age_s:.3f} s ago; allowed {valid_for_s:g} s"


def nobody_waits(heard_s: float, now_s: float) -> str:
    """A client that is slow, asks without end or goes keeps no setpoint from the others.

    heard_s : when the client that watches has got its last setpoint, s.
    """
    if now_s - heard_s <= HEARS_WITHIN_S:
        return ""
    return f"a client that watches has got no setpoint for {now_s - heard_s:.3f} s; allowed {HEARS_WITHIN_S:g} s"


def mostly_valid(coverage: Coverage, without_faults: bool) -> str:
    """In a world without faults at least 99 % of the setpoints are valid."""
    setpoints = coverage.all.total()
    if not without_faults or not setpoints:
        return ""
    share = coverage.valid.total() / setpoints
    return (
        "" if share >= VALID_SHARE else f"{100 * share:.2f} % valid without a fault; at least {100 * VALID_SHARE:g} %"
    )
