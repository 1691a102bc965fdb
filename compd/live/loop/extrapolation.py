"""Readings carried on to the time of a cycle, and how uncertain they are by their age.

A reading is as old as its gauge's turn on the line makes it, and each is differently old. Each is carried on by its own
speed (`compd.live.acquisition.motion_estimate`), which comes with it: so a replay has all that the cycle had. One of a
gauge that does not answer any more is not carried away: after two rounds or 0.15 s, or at the standstill to which it
braked, it stays where it is.
"""

from __future__ import annotations

from compd.gauge import Reading

# A device samples up to so long after the request or the trigger has left, s; a reading has the earliest time possible.
SAMPLED_LATER_S = 1e-3


def extrapolated(reading: Reading, now_s: float) -> float:
    """The value of a length (mm) at the monotonic time `now_s` (s)."""
    value, time_s, _, _, motion = reading
    if motion is None or motion[0] == 0.0:
        return value
    speed, braking, _, horizon_s = motion
    age_s = now_s - time_s
    carried_s = age_s if age_s < horizon_s else horizon_s
    return value + (speed - 0.5 * (braking if speed > 0.0 else -braking) * carried_s) * carried_s


def drift_mm_per_s(reading: Reading) -> float:
    """How fast a length may move that is not read any more: its speed and the uncertainty of that; nan if unknown.

    0 for a reading without motion, as in `age_uncertainty_mm`.
    """
    motion = reading.motion
    return 0.0 if motion is None else abs(motion.speed_mm_per_s) + motion.u_mm_per_s


def age_uncertainty_mm(reading: Reading, now_s: float, carried_on: bool) -> float:
    """Standard uncertainty (mm) of a length by the age of its reading; nan where its motion is not known yet.

    0 for a reading without motion: of a gauge that is no length, or in a recording of a release up to 0.2.0.
    carried_on : whether `extrapolated` is used, and not the value as it was read.
    """
    _, time_s, _, _, motion = reading
    if motion is None:
        return 0.0
    speed, _, u_mm_per_s, horizon_s = motion
    age_s = now_s - time_s
    by_age_mm = u_mm_per_s * age_s
    if speed == 0.0:
        return by_age_mm
    not_carried_s = age_s
    if carried_on:
        not_carried_s = age_s - horizon_s if age_s > horizon_s else 0.0
    return by_age_mm + abs(speed) * (SAMPLED_LATER_S + not_carried_s)
