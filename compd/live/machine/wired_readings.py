"""The readings of wires in one snapshot, carried on to its time, and how wrong they may be by their age.

A reading is as old as its gauge's turn on the line makes it, and each is differently old. Each is carried on by its own
speed (`compd.live.acquisition.motion_estimate`), which comes with it: so a replay has all that the cycle had. One of a
gauge that does not answer any more is not carried away: after two rounds or 0.15 s, or at the standstill to which it
braked, it stays where it is.

A reading without motion, whose horizon_s is nan, is of a gauge that is no length, or in a recording of a release up to
0.2.0.
"""

from __future__ import annotations

import math
from typing import Any

from numba import types
from numpy.typing import NDArray

from compd.arrays import FloatArray, IntArray
from compd.jit import COUNT, FLAG, INDICES, NUMBERS, SCALAR, helper, loop
from compd.live.memory import OK_NUMBER, SLOTS
from compd.reading import ROUNDS_UNTIL_DUE
from compd.units import UM_PER_MM

# Coverage factor for 95 % of a normal distribution (GUM, table G.1).
COVERAGE = 1.96
# Links move at speeds of one size, but near a singular pose: of two, one is up to so many times as fast as the other.
LINK_SPEED_RATIO = 10.0

# A machine that has rested for so many times as long as a reading is old has left since with 5 %: Laplace's rule of
# succession, for a time of which nothing else is known.
RESTED = 19.0

# Arrays that may be in memory that cannot be written to, such as those of a recording.
_READ_NUMBERS = types.Array(types.float64, 1, "C", readonly=True)
_READ_ROWS = types.Array(types.float64, 2, "C", readonly=True)


@helper
def _carried(slot: Any, age_s: float) -> float:
    """By how much (mm) a length is carried on to `age_s` (s) after its reading."""
    speed = slot.speed_mm_per_s
    carried_s = age_s if age_s < slot.horizon_s else slot.horizon_s
    braking = slot.braking_mm_per_s2 if speed > 0.0 else -slot.braking_mm_per_s2
    return float((speed - 0.5 * braking * carried_s) * carried_s)


@helper
def _extrapolated(slot: Any, now_s: float) -> float:
    """The value of a length (mm) at the monotonic time `now_s` (s)."""
    if math.isnan(slot.horizon_s) or slot.speed_mm_per_s == 0.0:
        return float(slot.value)
    return float(slot.value + _carried(slot, now_s - slot.time_s))


@loop([SLOTS, INDICES, NUMBERS, NUMBERS, NUMBERS, SCALAR, FLAG, NUMBERS])
def read_values(
    slots: NDArray[Any],
    wired: IntArray,
    stale_after_s: FloatArray,
    sign: FloatArray,
    zero: FloatArray,
    now_s: float,
    extrapolate: bool,
    values: FloatArray,
) -> tuple[float, float, bool]:
    """Fill in `values` (k,), sign * (reading - zero) of the slots `wired` (k,).

    stale_after_s : (k,) age from which a reading must not be used.  extrapolate : carry each reading on to `now_s`.
    Returns the times of the oldest and the newest reading, inf and -inf without wires, and whether all can be used.
    """
    oldest_s, newest_s, usable = math.inf, -math.inf, True
    for i in range(len(wired)):
        slot = slots[wired[i]]
        value = _extrapolated(slot, now_s) if extrapolate else slot.value
        values[i] = (value - zero[i]) * sign[i]
        oldest_s, newest_s = min(oldest_s, slot.time_s), max(newest_s, slot.time_s)
        if slot.quality != OK_NUMBER or now_s - slot.time_s > stale_after_s[i]:
            usable = False
    return oldest_s, newest_s, usable


@helper
def _speed_bound(slot: Any) -> float:
    """How fast a length moves at most at its last reading (mm/s), with 95 %; nan where that is not known yet."""
    return float(abs(slot.speed_mm_per_s) + COVERAGE * slot.u_mm_per_s)


@loop([SLOTS, INDICES, NUMBERS])
def speed_bounds_mm_per_s(slots: NDArray[Any], wired: IntArray, speeds: FloatArray) -> None:
    """Fill in how fast each length (k,) moves at most, mm/s; 0 for a reading without motion."""
    for i in range(len(wired)):
        slot = slots[wired[i]]
        speeds[i] = 0.0 if math.isnan(slot.horizon_s) else _speed_bound(slot)


@helper
def _shows_motion(slot: Any, tolerance_mm: float) -> bool:
    """Whether a length moves by more than its readings scatter from one round to the next."""
    return bool(_speed_bound(slot) * slot.due_s > ROUNDS_UNTIL_DUE * tolerance_mm)


@helper
def _unseen_speed(slot: Any, acceleration: float) -> float:
    """How much faster (mm/s) a length may be than its readings show: as if it had begun to accelerate in the window."""
    if slot.u_mm_per_s == 0.0:
        return 0.0
    return math.sqrt(2.0 * acceleration * slot.u_mm_per_s * slot.window_s)


@helper
def _machine_speed(
    slots: NDArray[Any], wired: IntArray, scales: int, now_s: float, acceleration: FloatArray, tolerance_mm: FloatArray
) -> float:
    """How fast (mm/s) the links move at most by the scales that answer: 0 where all stand, inf where none answers."""
    speed = -1.0
    for i in range(scales):
        slot = slots[wired[i]]
        if slot.quality != OK_NUMBER or now_s - slot.time_s > slot.due_s:
            continue
        speed = max(speed, 0.0)
        if _shows_motion(slot, tolerance_mm[i]):
            speed = max(speed, _speed_bound(slot) + _unseen_speed(slot, acceleration[i]))
    return math.inf if speed < 0.0 else speed


@helper
def _unwatched(slots: NDArray[Any], wired: IntArray, scales: int, now_s: float) -> float:
    """For how long (s) the machine may have been in motion, though its scales stand: since the oldest reading of those
    that answer, where it has not rested for long before that."""
    rested, unwatched = math.inf, 0.0
    for i in range(scales):
        slot = slots[wired[i]]
        age_s = now_s - slot.time_s
        if slot.quality == OK_NUMBER and age_s <= slot.due_s:
            rested, unwatched = min(rested, slot.rest_s), max(unwatched, age_s)
    return unwatched if rested < RESTED * unwatched else 0.0


@helper
def _rests_since(slots: NDArray[Any], wired: IntArray, scales: int, now_s: float) -> float:
    """For how long (s) all scales that answer have stood, until now."""
    rested = math.inf
    for i in range(scales):
        slot = slots[wired[i]]
        age_s = now_s - slot.time_s
        if slot.quality == OK_NUMBER and age_s <= slot.due_s:
            rested = min(rested, slot.rest_s + age_s)
    return rested


@helper
def _age_bound(
    slot: Any,
    age_s: float,
    extrapolate: bool,
    fastest: float,
    acceleration: float,
    tolerance_mm: float,
    machine_mm_per_s: float,
    unwatched_s: float,
) -> float:
    """By how much a length (mm) may have left the place to which it is carried on; see `age_bounds_mm`."""
    if math.isnan(slot.u_mm_per_s):
        return math.nan
    if age_s <= 0.0:
        return 0.0
    carried_mm = _carried(slot, age_s) if extrapolate else 0.0
    # by the limit of acceleration: the mean speed was that of the middle of its window
    by_limit = abs(slot.mean_mm_per_s * age_s - carried_mm) + 0.5 * acceleration * age_s * (age_s + slot.window_s)
    by_limit = min(by_limit, fastest * age_s + abs(carried_mm))
    # by what the machine does
    speed = _speed_bound(slot) + machine_mm_per_s
    if _shows_motion(slot, tolerance_mm):
        speed += _unseen_speed(slot, acceleration)
    left_s = min(age_s, unwatched_s)
    left_mm = 0.5 * acceleration * left_s * left_s if left_s > 0.0 else 0.0
    return float(min(by_limit, speed * age_s + left_mm) + slot.late_s * _speed_bound(slot))


@loop([SLOTS, INDICES, COUNT, SCALAR, FLAG, NUMBERS, NUMBERS, NUMBERS, SCALAR, NUMBERS])
def age_bounds_mm(
    slots: NDArray[Any],
    wired: IntArray,
    scales: int,
    now_s: float,
    extrapolate: bool,
    fastest: FloatArray,
    acceleration: FloatArray,
    tolerance_mm: FloatArray,
    largest_mm: float,
    bounds_mm: FloatArray,
) -> float:
    """Fill in by how much each length (k,) in mm may be wrong by the age of its reading, and return how fast (mm/s) the
    links move by those of the first `scales` of them that answer; inf where none does.

    Since its reading a length has changed its speed by no more than `acceleration` (k,) allows, in mm/s2, nor has it
    been faster than `fastest` (k,), mm/s. Nor has a scale been more than LINK_SPEED_RATIO times as fast as the fastest
    scale, nor joints and frame faster than the links: while all scales that answer stand, all stands. So a machine that
    has rested for RESTED times as long is taken to rest until the next reading of its scales is due. One that has come
    to rest just now may have left again, and one whose scales are silent is not taken to rest. What was read before the
    scales stood has gone on since.

    nan where it is not known how a length moves, inf where nothing limits it; 0 for a reading without motion.
    extrapolate : whether readings are carried on, and not used as they were read.
    tolerance_mm : (k,) by which two readings of the same value may differ.
    largest_mm : of lengths that are no scales, none is further off.
    """
    machine = _machine_speed(slots, wired, scales, now_s, acceleration, tolerance_mm)
    unwatched = _unwatched(slots, wired, scales, now_s)
    rested = _rests_since(slots, wired, scales, now_s)
    for i in range(len(wired)):
        slot = slots[wired[i]]
        if math.isnan(slot.horizon_s):
            bounds_mm[i] = 0.0
            continue
        links = LINK_SPEED_RATIO * machine if i < scales else machine
        age = now_s - slot.time_s
        left = max(unwatched, age - rested)
        bound = _age_bound(slot, age, extrapolate, fastest[i], acceleration[i], tolerance_mm[i], links, left)
        bounds_mm[i] = bound if i < scales or math.isnan(bound) else min(bound, largest_mm)
    return machine


@loop([SCALAR, _READ_ROWS, _READ_NUMBERS, COUNT])
def tip_bound_um(noise_um: float, tip_by_length: FloatArray, lengths_mm: FloatArray, scales: int) -> float:
    """How far the tip may be from where it is said to be, um: see `compd.live.loop.tip_bound`.

    noise_um : radius of 95 % by noise, um.  tip_by_length (3, k) mm per mm.  lengths_mm (k,) bound of each length,
    the scales first.  nan where one of them is.
    """
    scattered = noise_um * noise_um
    for axis in range(3):
        for i in range(scales, len(lengths_mm)):
            scattered += (UM_PER_MM * tip_by_length[axis, i] * lengths_mm[i]) ** 2
    furthest = 0.0
    for signs in range(1 << max(scales - 1, 0)):  # of the last scale one sign is enough
        square = 0.0
        for axis in range(3):
            moved = 0.0
            for i in range(scales):
                sign = -1.0 if signs >> i & 1 else 1.0
                moved += sign * tip_by_length[axis, i] * lengths_mm[i]
            square += moved * moved
        furthest = max(furthest, square) if not math.isnan(square) else math.nan
    return float(UM_PER_MM * math.sqrt(furthest) + math.sqrt(scattered))
