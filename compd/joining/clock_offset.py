r"""The offset between the recording's clock and an instrument's clock, from the motion that both recorded.

No kinematic model is needed: whatever the machine is, the position of its tip is a smooth function of its scale values.
At the right offset a polynomial of the scales explains what the instrument measured; at a wrong one it does not.

1. Candidates. The speed of the machine's scales and the speed of the instrument's target, on a common grid of time, are
   correlated at every lag (time delay estimation by cross-correlation: Knapp and Carter, IEEE Trans. Acoust. Speech
   Signal Process. 24 (1976) 320), normalised on the overlap (Padfield, IEEE Trans. Image Process. 21 (2012) 2706).
   The highest, well separated maxima are kept.
2. Refinement. At each candidate the offset :math:`\tau` is scanned for the greatest agreement: the adjusted coefficient
   of determination (Draper and Smith, Applied Regression Analysis, 3rd ed., 1998) of the regression of the instrument's
   positions :math:`y(t - \tau)` on monomials of the scales, with the number of independent places in the role of the
   number of rows.
3. Decision. The best offset must explain nearly all, and clearly more than any other offset.
4. Uncertainty. The scatter of the best offset between blocks of time (GUM 4.2), and the half-width of the range in
   which a dwell makes all offsets alike, as a rectangular distribution (GUM 4.3.7), in quadrature.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from scipy.signal import correlate, correlation_lags

from compd.arrays import BoolArray, FloatArray
from compd.errors import Problem, RecordingError
from compd.instruments.track import Track

# Both must move by more than this for a pattern to be seen; ten times what counts as a reversal.
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
# Most rows in the regression, most steps of the common grid of time, most candidates.
_MOST_ROWS = 2000
_MOST_STEPS = 2**18
_CANDIDATES = 8
# Offsets in one scan of the refinement.
_SCAN = 201
# Blocks of time whose best offsets are compared with each other.
_BLOCKS = 6


@dataclass(frozen=True)
class ClockOffset:
    """recording time = instrument time + offset_s.

    Attributes
    ----------
    std_s : standard uncertainty: scatter between blocks of time, and how long the machine dwells (within a
        dwell no offset is better than another). nan for an offset that a person gave.
    agreement : share of the instrument's variance that a polynomial of the scales explains, at most 1; nan where
        too few places were visited.
    runner_up : (offset_s, agreement) of the next best; None where there is none.
    """

    offset_s: float
    std_s: float
    agreement: float
    runner_up: tuple[float, float] | None = None


def estimate_offset(time_s: FloatArray, scale_mm: FloatArray, track: Track) -> ClockOffset:
    """Estimate the offset from the recording's (N,) times and (N, n) scales, and the instrument's track.

    Raises RecordingError where one of them stands still, too few rows overlap, or several offsets fit.
    """
    motion = _SharedMotion(time_s, scale_mm, track)
    motion.check()
    window_s = max(2.0 * motion.period_s, 5.0 * track.period_s, 2.0 * _decorrelation_time_s(track))
    # (agreement, offset), best first
    maxima = sorted((_refine(motion, start_s, window_s) for start_s in _candidates_s(motion, window_s)), reverse=True)
    maxima = [maximum for maximum in maxima if np.isfinite(maximum[0])]
    if not maxima or maxima[0][0] < LEAST_AGREEMENT:
        best = f"{maxima[0][0]:.3f}" if maxima else "none"
        raise motion.refusal(
            "no offset makes the instrument follow the scales", f"agreement {best}", f"{LEAST_AGREEMENT} or more"
        )
    agreement, offset_s = maxima[0]
    others = [maximum for maximum in maxima[1:] if abs(maximum[1] - offset_s) > window_s]
    runner_up = (others[0][1], others[0][0]) if others else None
    if runner_up and 1.0 - runner_up[1] < max(ALIKE, CLEARLY_WORSE * (1.0 - agreement)):
        raise motion.refusal(
            "two offsets fit equally well, as when one motion is repeated",
            f"{offset_s:.3f} s (agreement {agreement:.6f}) and {runner_up[0]:.3f} s ({runner_up[1]:.6f})",
            "one that is clearly better",
        )
    early_s, late_s = _indistinguishable_range_s(motion, offset_s, window_s)
    middle_s = offset_s + (late_s - early_s) / 2.0
    half_width_s = (early_s + late_s) / 2.0
    std_s = float(np.hypot(_standard_error_s(motion, offset_s, window_s), half_width_s / np.sqrt(3.0)))
    return ClockOffset(float(middle_s), std_s, motion.agreement(middle_s), runner_up)


def evaluate_offset(time_s: FloatArray, scale_mm: FloatArray, track: Track, offset_s: float) -> ClockOffset:
    """An offset that a person gave, with the agreement that it reaches; nothing is refused."""
    return ClockOffset(offset_s, np.nan, _SharedMotion(time_s, scale_mm, track).agreement(offset_s))


class _SharedMotion:
    """The motion as the scales and as the instrument recorded it, thinned where there are more rows than needed.

    Attributes
    ----------
    all_time_s, all_scale_mm : (M,), (M, n) rows with every scale.
    time_s : (N,) of the thinned rows. travel : (N,) path so far in units of the places' spread.
    terms : (N, p) monomials of the scales; None where there are too few places for any.
    period_s : median time between two rows.
    """

    def __init__(self, time_s: FloatArray, scale_mm: FloatArray, track: Track) -> None:
        complete = np.isfinite(scale_mm).all(axis=1)
        self.track = track
        self.all_time_s, self.all_scale_mm = time_s[complete], scale_mm[complete]
        thin = slice(None, None, -(-max(len(self.all_time_s), 1) // _MOST_ROWS))
        self.time_s = self.all_time_s[thin]
        self.travel = _travel(self.all_scale_mm)[thin]
        places = min(len(self.time_s), int(self.travel.max(initial=0.0)))
        self.terms = _monomials(self.all_scale_mm[thin], places)
        self.period_s = float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 0.0

    def check(self) -> None:
        """Raise RecordingError where there is too little motion for a pattern."""
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
        """The error that the offset cannot be estimated."""
        return RecordingError(
            Problem(
                where=str(self.track.path),
                what=f"the clock offset cannot be told: {what}",
                value=value,
                allowed=allowed,
                next_step="record with moves between dwells of different length, or give --offset S; join points at "
                "rest --by order, name or distance",
            )
        )

    def covered(self, earliest_s: float, latest_s: float) -> BoolArray:
        """(N,) rows that the track covers at every offset between the two."""
        first_s, last_s = float(self.track.time_s[0]), float(self.track.time_s[-1])
        rows: BoolArray = (self.time_s - latest_s >= first_s) & (self.time_s - earliest_s <= last_s)
        return rows

    def agreement(self, offset_s: float) -> float:
        """As `agreements`, of one offset on all rows that it covers."""
        return float(self.agreements(np.array([offset_s]), self.covered(offset_s, offset_s))[0])

    def agreements(self, offsets_s: FloatArray, rows: BoolArray) -> FloatArray:
        r"""Adjusted coefficient of determination on `rows` at each offset; nan where there are too few places.

        With :math:`y` the centred positions at an offset, :math:`Q` an orthonormal basis of the :math:`p` monomials and
        :math:`m` independent places: :math:`1 - (|y - Q Q^T y|^2 / |y|^2) (m - 1) / (m - p)`.
        """
        travel = self.travel[rows]
        places = min(len(travel), float(np.ptp(travel))) if len(travel) else 0.0
        if self.terms is None or places < _LEAST_PLACES_PER_TERM * self.terms.shape[1]:
            return np.full(len(offsets_s), np.nan)
        basis, _ = np.linalg.qr(self.terms[rows])
        result = np.empty(len(offsets_s))
        for i, offset_s in enumerate(offsets_s):
            position_mm = self.track.position_at(self.time_s[rows] - offset_s)
            position_mm -= position_mm.mean(axis=0)
            residual_mm = position_mm - basis @ (basis.T @ position_mm)
            total = max(float(np.sum(position_mm**2)), 1e-30)
            unexplained = float(np.sum(residual_mm**2)) / total
            result[i] = 1.0 - unexplained * (places - 1.0) / (places - basis.shape[1])
        return result


def _travel(scale_mm: FloatArray) -> FloatArray:
    """(N,) length of the path so far over the spread of the places: how many independent places were visited.

    A row every millisecond is not a thousand places a second. For random targets a move is 1.3 times the spread.
    """
    if len(scale_mm) < 2:
        return np.zeros(len(scale_mm))
    path_mm = np.cumsum(np.linalg.norm(np.diff(scale_mm, axis=0, prepend=scale_mm[:1]), axis=1))
    travel: FloatArray = path_mm / max(float(np.sqrt(np.var(scale_mm, axis=0).sum())), MOTION_MM)
    return travel


def _monomials(scale_mm: FloatArray, places: int) -> FloatArray | None:
    """(N, p) monomials of the scales up to degree 3, 2 or 1, as the places allow; None where even 1 is too much."""
    rows, scales = scale_mm.shape
    spread_mm = np.maximum(np.std(scale_mm, axis=0), 1e-9) if rows else np.ones(scales)
    standardised = (scale_mm - (scale_mm.mean(axis=0) if rows else 0.0)) / spread_mm
    for degree in (3, 2, 1):
        monomials = [
            factors for order in range(degree + 1) for factors in combinations_with_replacement(range(scales), order)
        ]
        if places >= _PLACES_PER_TERM * len(monomials):
            return np.column_stack([np.prod(standardised[:, list(factors)], axis=1) for factors in monomials])
    return None


def _candidates_s(motion: _SharedMotion, window_s: float) -> list[float]:
    """Offsets at which the two speeds correlate best, each further than `window_s` from the others."""
    track = motion.track
    span_s = np.ptp(motion.all_time_s) + np.ptp(track.time_s)
    step_s = max(track.period_s, motion.period_s / 8.0, float(span_s) / _MOST_STEPS)

    def root_speed(time_s: FloatArray, position_mm: FloatArray) -> FloatArray:
        grid_s = np.arange(time_s[0], time_s[-1], step_s)
        on_grid = np.column_stack([np.interp(grid_s, time_s, column) for column in position_mm.T])
        # the root keeps one long move from outweighing the pattern of the others
        root: FloatArray = np.sqrt(np.linalg.norm(np.diff(on_grid, axis=0), axis=1))
        return root

    machine = root_speed(motion.all_time_s, motion.all_scale_mm)
    instrument = root_speed(track.time_s, track.position_mm)
    correlation = _overlap_correlation(machine, instrument)
    lags = correlation_lags(len(machine), len(instrument))
    offsets_s = motion.all_time_s[0] - track.time_s[0] + lags * step_s
    candidates_s: list[float] = []
    for i in np.argsort(correlation)[::-1]:
        if len(candidates_s) == _CANDIDATES or not np.isfinite(correlation[i]) or correlation[i] <= 0:
            break
        if all(abs(offsets_s[i] - other_s) > window_s for other_s in candidates_s):
            candidates_s.append(float(offsets_s[i]))
    return candidates_s


def _decorrelation_time_s(track: Track) -> float:
    """The shift at which the motion's speed has lost half of its correlation with itself."""
    speed = np.sqrt(np.linalg.norm(np.diff(track.position_mm, axis=0), axis=1))[:_MOST_STEPS]
    autocorrelation = _overlap_correlation(speed, speed)[len(speed) - 1 :]
    below_half = np.flatnonzero(autocorrelation < 0.5)
    return float(below_half[0]) * track.period_s if len(below_half) else float(np.ptp(track.time_s)) / 4.0


def _overlap_correlation(machine: FloatArray, instrument: FloatArray) -> FloatArray:
    r"""Correlation coefficient of the overlapping samples at every lag, in the order of scipy's `correlation_lags`.

    With :math:`n` overlapping samples :math:`a, b` at a lag

    .. math:: r = \frac{\sum ab - \sum a \sum b / n}{\sqrt{\sum a^2 - (\sum a)^2 / n} \sqrt{\sum b^2 - (\sum b)^2 / n}},

    every sum over the overlap being a correlation with ones (Padfield 2012).

    Returns
    -------
    (len(machine) + len(instrument) - 1,) coefficients; -1 where less than half of the shorter one overlaps.
    """
    ones_machine, ones_instrument = np.ones(len(machine)), np.ones(len(instrument))

    def sums(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(correlate(a, b, mode="full", method="fft"), dtype=np.float64)

    count = np.maximum(np.rint(sums(ones_machine, ones_instrument)), 1.0)
    sum_machine, sum_instrument = sums(machine, ones_instrument), sums(ones_machine, instrument)
    var_machine = sums(machine**2, ones_instrument) - sum_machine**2 / count
    var_instrument = sums(ones_machine, instrument**2) - sum_instrument**2 / count
    covariance = sums(machine, instrument) - sum_machine * sum_instrument / count
    scale = np.sqrt(np.maximum(var_machine, 0.0) * np.maximum(var_instrument, 0.0))
    # a variance as small as the rounding of the Fourier transform counts as none
    has_variance = scale > 1e-9 * max(float(scale.max()), 1e-300)
    overlaps = count >= 0.5 * min(len(machine), len(instrument))
    correlation = np.full(len(count), -1.0)
    np.divide(covariance, scale, out=correlation, where=has_variance & overlaps)
    return correlation


def _refine(motion: _SharedMotion, start_s: float, window_s: float) -> tuple[float, float]:
    """(agreement, offset) of the best offset within the window, by scans of an ever smaller span."""
    centre_s, half_span_s = start_s, window_s
    agreement = np.nan
    while True:
        offsets_s = centre_s + np.linspace(-half_span_s, half_span_s, _SCAN)
        values = motion.agreements(offsets_s, motion.covered(offsets_s[0], offsets_s[-1]))
        if not np.isfinite(values).all():
            return -np.inf, start_s
        best = int(np.argmax(values))
        agreement, centre_s = float(values[best]), float(offsets_s[best])
        step_s = 2.0 * half_span_s / (_SCAN - 1)
        if step_s < motion.track.period_s / 50.0:
            return agreement, centre_s
        half_span_s = 4.0 * step_s


def _indistinguishable_range_s(motion: _SharedMotion, offset_s: float, window_s: float) -> tuple[float, float]:
    """(earlier, later) how far the offset may move before the rows' positions change by more than can be seen."""
    rows = motion.covered(offset_s - window_s, offset_s + window_s)
    position_mm = motion.track.position_at(motion.time_s[rows] - offset_s)
    # three standard errors of what the polynomial leaves over (it is no noise), or two of the instrument's noise
    variance_mm2 = (1.0 - motion.agreement(offset_s)) * np.mean(np.var(position_mm, axis=0))
    misfit_mm = np.sqrt(variance_mm2 / len(position_mm))
    limit_mm = max(3.0 * float(misfit_mm), 2.0 * motion.track.noise_mm, 1e-4)
    steps_s = np.linspace(0.0, window_s, 2 * _SCAN)[1:]

    def reach_s(sign: float) -> float:
        for step_s in steps_s:
            shifted_mm = motion.track.position_at(motion.time_s[rows] - (offset_s + sign * step_s))
            if np.sqrt(np.mean((shifted_mm - position_mm) ** 2)) > limit_mm:
                return float(step_s - steps_s[0] / 2.0)
        return window_s

    return reach_s(-1.0), reach_s(1.0)


def _standard_error_s(motion: _SharedMotion, offset_s: float, window_s: float) -> float:
    """Standard error of the offset from blocks of time, each with its own best offset on the common polynomial."""
    rows = motion.covered(offset_s - window_s, offset_s + window_s)
    if motion.terms is None:
        return np.nan
    terms = motion.terms[rows]
    fitted_mm = terms @ np.linalg.lstsq(terms, motion.track.position_at(motion.time_s[rows] - offset_s), rcond=None)[0]
    block = np.arange(len(terms)) * _BLOCKS // len(terms)
    span_s = max(20.0 * motion.track.period_s, window_s / 4.0)
    offsets_s = offset_s + np.linspace(-span_s, span_s, 4 * _SCAN)
    squares = np.empty((len(offsets_s), _BLOCKS))
    for i, trial_s in enumerate(offsets_s):
        residual_mm = motion.track.position_at(motion.time_s[rows] - trial_s) - fitted_mm
        squares[i] = np.bincount(block, np.sum(residual_mm**2, axis=1), _BLOCKS)
    best_s = offsets_s[np.argmin(squares, axis=0)]
    return float(np.std(best_s, ddof=1) / np.sqrt(_BLOCKS))
