"""The offset between the recording's clock and an instrument's, from the motion that both saw.

No kinematic model is needed: whatever the machine is, the place of its tip is a smooth function of its scales. At the
right offset a polynomial of the scales explains what the instrument saw; at a wrong one it does not. Where to
look is found first by correlating how fast both moved.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.errors import Problem, RecordingError
from compd.recording.instrument_export import Track

# Both must move by more than this for a pattern to be seen; ten times what `recording.STILL_MM` calls still.
MOTION_MM = 0.01
# The least that the scales must explain of the instrument's variance. On simulated tripods the right offset
# explains 0.995 or more; unrelated motions, with some twenty moves, reach up to 0.6 by chance.
LEAST_AGREEMENT = 0.9
# What any other offset must leave unexplained: more than this share of the variance (between samples, linear
# interpolation alone may miss a tenth of it), and more than this many times what the best one leaves.
ALIKE = 0.01
CLEARLY_WORSE = 2.0
# Independent places per term of the polynomial: in the whole recording, and in the part that overlaps.
_PLACES_PER_TERM = 5
_LEAST_PLACES_PER_TERM = 2
_MOST_ROWS = 2000
_MOST_STEPS = 2**18
_CANDIDATES = 8
_SCAN = 201
_BLOCKS = 6


@dataclass(frozen=True)
class Offset:
    """recording time = instrument time + offset_s.

    std_s : standard uncertainty: scatter between blocks of time, and how long the machine dwells (within a
        dwell no offset is better than another). nan for an offset given by hand.
    agreement : share of the instrument's variance that a polynomial of the scales explains, at most 1; nan where
        too few places were seen.
    runner_up : (offset_s, agreement) of the next best; None where there is none.
    """

    offset_s: float
    std_s: float
    agreement: float
    runner_up: tuple[float, float] | None = None


def estimate_offset(time_s: FloatArray, scale_mm: FloatArray, track: Track) -> Offset:
    """The offset from the recording's (N,) times and (N, n) scales against the track.

    Raises RecordingError where one of them stands still, too few rows overlap, or several offsets fit.
    """
    motion = _Motion(time_s, scale_mm, track)
    motion.check()
    window_s = max(2.0 * motion.period_s, 5.0 * track.period_s, 2.0 * _memory_s(track))
    found = sorted((_refined(motion, start, window_s) for start in _candidates(motion, window_s)), reverse=True)
    found = [pair for pair in found if np.isfinite(pair[0])]
    if not found or found[0][0] < LEAST_AGREEMENT:
        best = f"{found[0][0]:.3f}" if found else "none"
        raise motion.refusal(
            "no offset makes the instrument follow the scales", f"agreement {best}", f"{LEAST_AGREEMENT} or more"
        )
    agreement, offset_s = found[0]
    others = [pair for pair in found[1:] if abs(pair[1] - offset_s) > window_s]
    runner_up = (others[0][1], others[0][0]) if others else None
    if runner_up and 1.0 - runner_up[1] < max(ALIKE, CLEARLY_WORSE * (1.0 - agreement)):
        raise motion.refusal(
            "two offsets fit equally well, as when one motion is repeated",
            f"{offset_s:.3f} s (agreement {agreement:.6f}) and {runner_up[0]:.3f} s ({runner_up[1]:.6f})",
            "one that is clearly better",
        )
    early_s, late_s = _flat(motion, offset_s, window_s)
    middle_s = offset_s + (late_s - early_s) / 2.0
    half_s = (early_s + late_s) / 2.0
    std_s = float(np.hypot(_scatter(motion, offset_s, window_s), half_s / np.sqrt(3.0)))
    return Offset(float(middle_s), std_s, motion.agreement(middle_s), runner_up)


def agreement_at(time_s: FloatArray, scale_mm: FloatArray, track: Track, offset_s: float) -> Offset:
    """An offset given by hand, with the agreement that it reaches; nothing is refused."""
    return Offset(offset_s, np.nan, _Motion(time_s, scale_mm, track).agreement(offset_s))


class _Motion:
    """Both motions, thinned where there are more rows than needed."""

    def __init__(self, time_s: FloatArray, scale_mm: FloatArray, track: Track) -> None:
        whole = np.isfinite(scale_mm).all(axis=1)
        self.track = track
        self.all_time_s, self.all_scale_mm = time_s[whole], scale_mm[whole]
        thin = slice(None, None, -(-max(len(self.all_time_s), 1) // _MOST_ROWS))
        self.time_s = self.all_time_s[thin]
        self.travel = _travel(self.all_scale_mm)[thin]
        places = min(len(self.time_s), int(self.travel.max(initial=0.0)))
        self.terms = _terms(self.all_scale_mm[thin], places)
        self.period_s = float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 0.0

    def check(self) -> None:
        """Refuse what shows no pattern."""
        for what, values in (("the machine", self.all_scale_mm), ("the instrument", self.track.position_mm)):
            moved_mm = float(np.ptp(values, axis=0).max()) if len(values) else 0.0
            if moved_mm < MOTION_MM:
                raise self.refusal(
                    f"{what} stands still all the time", f"{moved_mm:.6f} mm", f"a motion of more than {MOTION_MM} mm"
                )
        if self.terms is None:
            scales = self.all_scale_mm.shape[1]
            raise self.refusal(
                "too few rows or places to see a pattern",
                f"{len(self.time_s)} rows",
                f"{_PLACES_PER_TERM * (scales + 1)} places far from each other",
            )

    def refusal(self, what: str, value: str, allowed: str) -> RecordingError:
        return RecordingError(
            Problem(
                where=str(self.track.path),
                what=f"the clock offset cannot be told: {what}",
                value=value,
                allowed=allowed,
                next_step="record with moves between dwells of different length, or give --offset S",
            )
        )

    def covered(self, earliest_s: float, latest_s: float) -> BoolArray:
        """Rows that the track covers at every offset between the two."""
        first_s, last_s = float(self.track.time_s[0]), float(self.track.time_s[-1])
        rows: BoolArray = (self.time_s - latest_s >= first_s) & (self.time_s - earliest_s <= last_s)
        return rows

    def agreement(self, offset_s: float) -> float:
        return float(self.agreements(np.array([offset_s]), self.covered(offset_s, offset_s))[0])

    def agreements(self, offsets_s: FloatArray, rows: BoolArray) -> FloatArray:
        """Share of variance explained on `rows` at each offset, less what as many terms explain by chance of as
        many independent places; nan where too few are left."""
        travel = self.travel[rows]
        places = min(len(travel), float(np.ptp(travel))) if len(travel) else 0.0
        if self.terms is None or places < _LEAST_PLACES_PER_TERM * self.terms.shape[1]:
            return np.full(len(offsets_s), np.nan)
        basis, _ = np.linalg.qr(self.terms[rows])
        result = np.empty(len(offsets_s))
        for i, offset_s in enumerate(offsets_s):
            position = self.track.at(self.time_s[rows] - offset_s)
            position -= position.mean(axis=0)
            left = position - basis @ (basis.T @ position)
            total = max(float(np.sum(position**2)), 1e-30)
            result[i] = 1.0 - float(np.sum(left**2)) / total * (places - 1.0) / (places - basis.shape[1])
        return result


def _travel(scale_mm: FloatArray) -> FloatArray:
    """(N,) length of the path so far over the spread of the places: how many independent places were seen.

    A row every millisecond is not a thousand places a second. For random targets a move is 1.3 times the spread.
    """
    if len(scale_mm) < 2:
        return np.zeros(len(scale_mm))
    path_mm = np.cumsum(np.linalg.norm(np.diff(scale_mm, axis=0, prepend=scale_mm[:1]), axis=1))
    travel: FloatArray = path_mm / max(float(np.sqrt(np.var(scale_mm, axis=0).sum())), MOTION_MM)
    return travel


def _terms(scale_mm: FloatArray, places: int) -> FloatArray | None:
    """(N, p) monomials of the scales up to degree 3, 2 or 1, as the places allow; None where even 1 is too much."""
    rows, scales = scale_mm.shape
    spread = np.maximum(np.std(scale_mm, axis=0), 1e-9) if rows else np.ones(scales)
    unit = (scale_mm - (scale_mm.mean(axis=0) if rows else 0.0)) / spread
    for degree in (3, 2, 1):
        powers = [
            powers for order in range(degree + 1) for powers in combinations_with_replacement(range(scales), order)
        ]
        if places >= _PLACES_PER_TERM * len(powers):
            return np.column_stack([np.prod(unit[:, list(power)], axis=1) for power in powers])
    return None


def _candidates(motion: _Motion, window_s: float) -> list[float]:
    """Offsets at which the two speeds correlate best, each further than `window_s` from the others."""
    track = motion.track
    span_s = np.ptp(motion.all_time_s) + np.ptp(track.time_s)
    step_s = max(track.period_s, motion.period_s / 8.0, float(span_s) / _MOST_STEPS)

    def pace(time_s: FloatArray, position_mm: FloatArray) -> FloatArray:
        grid_s = np.arange(time_s[0], time_s[-1], step_s)
        on_grid = np.column_stack([np.interp(grid_s, time_s, column) for column in position_mm.T])
        # the root keeps one long move from drowning the pattern of the others
        speed: FloatArray = np.sqrt(np.linalg.norm(np.diff(on_grid, axis=0), axis=1))
        return speed

    machine, instrument = pace(motion.all_time_s, motion.all_scale_mm), pace(track.time_s, track.position_mm)
    correlation = _correlation(machine, instrument)
    lags = np.arange(len(correlation)) - (len(instrument) - 1)
    offsets_s = motion.all_time_s[0] - track.time_s[0] + lags * step_s
    found: list[float] = []
    for i in np.argsort(correlation)[::-1]:
        if len(found) == _CANDIDATES or not np.isfinite(correlation[i]) or correlation[i] <= 0:
            break
        if all(abs(offsets_s[i] - other) > window_s for other in found):
            found.append(float(offsets_s[i]))
    return found


def _memory_s(track: Track) -> float:
    """How far the motion must be shifted to look unlike itself: half of the correlation of its speed is lost."""
    speed = np.sqrt(np.linalg.norm(np.diff(track.position_mm, axis=0), axis=1))[:_MOST_STEPS]
    own = _correlation(speed, speed)[len(speed) - 1 :]
    unlike = np.flatnonzero(own < 0.5)
    return float(unlike[0]) * track.period_s if len(unlike) else float(np.ptp(track.time_s)) / 4.0


def _correlation(machine: FloatArray, instrument: FloatArray) -> FloatArray:
    """(len(machine) + len(instrument) - 1,) correlation coefficient of the overlapping part at every lag; -1 where
    less than half of the shorter one overlaps."""
    size = len(machine) + len(instrument) - 1

    def slide(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.fft.irfft(np.fft.rfft(a, size) * np.fft.rfft(b[::-1], size), size)

    ones_m, ones_i = np.ones(len(machine)), np.ones(len(instrument))
    count = np.maximum(np.rint(slide(ones_m, ones_i)), 1.0)
    sum_m, sum_i = slide(machine, ones_i), slide(ones_m, instrument)
    var_m = slide(machine**2, ones_i) - sum_m**2 / count
    var_i = slide(ones_m, instrument**2) - sum_i**2 / count
    covariance = slide(machine, instrument) - sum_m * sum_i / count
    scale = np.sqrt(np.maximum(var_m, 0.0) * np.maximum(var_i, 0.0))
    # rounding of the transform: a variance this small is none
    sound = (count >= 0.5 * min(len(machine), len(instrument))) & (scale > 1e-9 * max(float(scale.max()), 1e-300))
    result = np.full(size, -1.0)
    np.divide(covariance, scale, out=result, where=sound)
    return result


def _refined(motion: _Motion, start_s: float, window_s: float) -> tuple[float, float]:
    """(agreement, offset) of the best offset within the window, by scans that halve their span again and again."""
    centre_s, half_s = start_s, window_s
    agreement = np.nan
    while True:
        offsets_s = centre_s + np.linspace(-half_s, half_s, _SCAN)
        values = motion.agreements(offsets_s, motion.covered(offsets_s[0], offsets_s[-1]))
        if not np.isfinite(values).all():
            return -np.inf, start_s
        best = int(np.argmax(values))
        agreement, centre_s = float(values[best]), float(offsets_s[best])
        step_s = 2.0 * half_s / (_SCAN - 1)
        if step_s < motion.track.period_s / 50.0:
            return agreement, centre_s
        half_s = 4.0 * step_s


def _flat(motion: _Motion, offset_s: float, window_s: float) -> tuple[float, float]:
    """(earlier, later) how far the offset may go before the rows' positions change by more than can be seen."""
    rows = motion.covered(offset_s - window_s, offset_s + window_s)
    here = motion.track.at(motion.time_s[rows] - offset_s)
    # three standard errors of what the polynomial leaves over (it is no noise), or two of the instrument's noise
    misfit_mm = np.sqrt((1.0 - motion.agreement(offset_s)) * np.mean(np.var(here, axis=0)) / len(here))
    limit_mm = max(3.0 * float(misfit_mm), 2.0 * motion.track.noise_mm, 1e-4)
    steps_s = np.linspace(0.0, window_s, 2 * _SCAN)[1:]

    def reach(sign: float) -> float:
        for step_s in steps_s:
            there = motion.track.at(motion.time_s[rows] - (offset_s + sign * step_s))
            if np.sqrt(np.mean((there - here) ** 2)) > limit_mm:
                return float(step_s - steps_s[0] / 2.0)
        return window_s

    return reach(-1.0), reach(1.0)


def _scatter(motion: _Motion, offset_s: float, window_s: float) -> float:
    """Standard error of the offset from blocks of time, each with its own best offset on the common polynomial."""
    rows = motion.covered(offset_s - window_s, offset_s + window_s)
    if motion.terms is None:
        return np.nan
    terms = motion.terms[rows]
    fitted = terms @ np.linalg.lstsq(terms, motion.track.at(motion.time_s[rows] - offset_s), rcond=None)[0]
    block = np.arange(len(terms)) * _BLOCKS // len(terms)
    span_s = max(20.0 * motion.track.period_s, window_s / 4.0)
    offsets_s = offset_s + np.linspace(-span_s, span_s, 4 * _SCAN)
    squares = np.array(
        [
            np.bincount(block, np.sum((motion.track.at(motion.time_s[rows] - o) - fitted) ** 2, axis=1), _BLOCKS)
            for o in offsets_s
        ]
    )
    best_s = offsets_s[np.argmin(squares, axis=0)]
    return float(np.std(best_s, ddof=1) / np.sqrt(_BLOCKS))
