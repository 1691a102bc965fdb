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

import numpy as np
from scipy.signal import correlate, correlation_lags

from compd.arrays import FloatArray
from compd.instruments import Track
from compd.joining.shared_motion import SharedMotion

# Least share of the instrument's variance that the scales must explain. On simulated tripods the right offset explains
# 0.995 or more; unrelated motions, with some twenty moves, reach up to 0.6 by chance.
MIN_AGREEMENT = 0.9
# Least unexplained variance of any other offset: this share of the variance (linear interpolation alone may miss a
# tenth of it between samples), and this multiple of the best one's.
ALIKE = 0.01
CLEARLY_WORSE = 2.0
# Limits: steps of the common grid of time, candidates,
_MAX_STEPS = 2**18
_CANDIDATES = 8
# and fewest steps of the shorter recording on that grid.
_MIN_STEPS = 3
# Offsets in one scan of the refinement.
_SCAN = 201
# Offsets of a picture: over all at which the two overlap, and near each candidate.
_OVERVIEW = 160
_NEAR = 41
# Blocks of time whose best offsets are compared with each other.
_BLOCKS = 6


@dataclass(frozen=True)
class ClockOffset:
    """recording time = instrument time + offset_s."""

    offset_s: float
    #: standard uncertainty: scatter between blocks of time, and how long the machine dwells (within a dwell no offset
    #: is better than another). nan for an offset that a person gave.
    std_s: float
    #: share of the instrument's variance that a polynomial of the scales explains, at most 1; nan where too few places
    #: were visited
    agreement: float
    runner_up: tuple[float, float] | None = None  #: (offset_s, agreement) of the next best; None if there is none


@dataclass(frozen=True)
class AgreementCurve:
    """offset_s : (K,) rising. agreement : (K,) at each of them, as in `ClockOffset`; nan where too little overlaps.

    window_s : how far from an offset no other counts as another one.
    """

    offset_s: FloatArray
    agreement: FloatArray
    window_s: float


def estimate_offset(time_s: FloatArray, scale_mm: FloatArray, track: Track) -> ClockOffset:
    """Estimate the offset from the recording's (N,) times and (N, n) scales, and the instrument's track.

    Raises RecordingError if one of them stands still, too few rows overlap, or several offsets fit.
    """
    motion = SharedMotion(time_s, scale_mm, track)
    motion.check()
    window_s = _window_s(motion)
    # (agreement, offset), best first
    maxima = sorted((_refine(motion, start_s, window_s) for start_s in _candidates_s(motion, window_s)), reverse=True)
    maxima = [maximum for maximum in maxima if np.isfinite(maximum[0])]
    if not maxima or maxima[0][0] < MIN_AGREEMENT:
        best = f"{maxima[0][0]:.3f}" if maxima else "none"
        raise motion.refusal(
            "no offset makes the instrument follow the scales", f"agreement {best}", f"{MIN_AGREEMENT} or more"
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
    """A given offset with its agreement; never refused."""
    return ClockOffset(offset_s, np.nan, SharedMotion(time_s, scale_mm, track).agreement(offset_s))


def agreement_curve(time_s: FloatArray, scale_mm: FloatArray, track: Track) -> AgreementCurve:
    """The agreement over all offsets at which the two overlap, more closely where `estimate_offset` looks: a picture.

    Raises RecordingError if one of them stands still, or too few places were visited.
    """
    motion = SharedMotion(time_s, scale_mm, track)
    motion.check()
    window_s = _window_s(motion)
    overlap_s = motion.time_s[0] - track.time_s[-1], motion.time_s[-1] - track.time_s[0]
    near = [start_s + np.linspace(-window_s, window_s, _NEAR) for start_s in _candidates_s(motion, window_s)]
    offsets_s = np.unique(np.concatenate([np.linspace(*overlap_s, _OVERVIEW), *near]))
    return AgreementCurve(offsets_s, np.array([motion.agreement(offset_s) for offset_s in offsets_s]), window_s)


def _window_s(motion: SharedMotion) -> float:
    """Largest distance (s) of a maximum from its candidate; others are farther away."""
    return max(2.0 * motion.period_s, 5.0 * motion.track.period_s, 2.0 * _decorrelation_time_s(motion.track))


def _candidates_s(motion: SharedMotion, window_s: float) -> list[float]:
    """Offsets at which the two speeds correlate best, each further than `window_s` from the others."""
    track = motion.track
    span_s = np.ptp(motion.all_time_s) + np.ptp(track.time_s)
    step_s = max(track.period_s, motion.period_s / 8.0, float(span_s) / _MAX_STEPS)

    def root_speed(time_s: FloatArray, position_mm: FloatArray) -> FloatArray:
        grid_s = np.arange(time_s[0], time_s[-1], step_s)
        on_grid = np.column_stack([np.interp(grid_s, time_s, column) for column in position_mm.T])
        # the root keeps one long move from outweighing the pattern of the others
        root: FloatArray = np.sqrt(np.linalg.norm(np.diff(on_grid, axis=0), axis=1))
        return root

    spans_s = [float(np.ptp(time_s)) for time_s in (motion.all_time_s, track.time_s)]
    if min(spans_s) < _MIN_STEPS * step_s:
        raise motion.refusal(
            "one of the two is too short beside the rows of the other",
            f"the gauges span {spans_s[0]:.3g} s, a row every {motion.period_s:.3g} s; the instrument {spans_s[1]:.3g} "
            f"s, a row every {track.period_s:.3g} s",
            "times in the same unit, of one measurement",
        )
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
    speed = np.sqrt(np.linalg.norm(np.diff(track.position_mm, axis=0), axis=1))[:_MAX_STEPS]
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


def _refine(motion: SharedMotion, start_s: float, window_s: float) -> tuple[float, float]:
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


def _indistinguishable_range_s(motion: SharedMotion, offset_s: float, window_s: float) -> tuple[float, float]:
    """(earlier, later) shift of the offset (s) at which the change of the rows' positions becomes significant."""
    rows = motion.covered(offset_s - window_s, offset_s + window_s)
    position_mm = motion.track.position_at(motion.time_s[rows] - offset_s)
    # three standard errors of the polynomial's residual (which is no noise), or two of the instrument's noise
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


def _standard_error_s(motion: SharedMotion, offset_s: float, window_s: float) -> float:
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
