"""A least-squares spectrum of unevenly spaced values: how much of them a sine of each period explains.

At each frequency f a sine, a cosine and a constant are fitted to every series (generalized Lomb-Scargle periodogram;
M. Zechmeister, M. Kuerster, Astronomy & Astrophysics 496 (2009) 577, equations (4) to (15)), and the mean squares that
they explain are added up over the series. A parabola in the quantity is taken away before: what is slow has other
causes. The sums over rows are computed for all frequencies f_k = first + k step at once. With k = a B + b each phase
factor is a product, and the sums are one product of matrices,

    sum_n y_n exp(2 pi i f_k q_n) = sum_n [y_n exp(2 pi i (first + a B step) q_n)] [exp(2 pi i b step q_n)]

in single precision, which is exact to 1e-6 of the largest.

Two limits bound the periods. Values at places that lie on an even grid (every 5 mm) repeat above half its frequency:
the spectral window |mean exp(2 pi i f q)| is 1 there, and what is above half of such a frequency is an image of what
is below (J. T. VanderPlas, Astrophysical Journal Supplement 236 (2018) 16, section 4.2). Uneven places have no such
limit; there the number of frequencies ends the search.

Example: which periods of a position fit a residual best::

    search = strongest_periods(position_mm[:, None], residual_um[:, None], PeriodLimits(0.01, 50.0))
    search.periods      # (1.370, 0.685, ...), the strongest first
    search.independent  # 5000 frequencies that do not resemble one another were searched
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray, IntArray
from compd.statistics.least_squares import solve_least_squares
from compd.statistics.robust import robust_sigma


@dataclass(frozen=True)
class PeriodCriteria:
    """The search for the period of an effect in a residual."""

    peaks: int = 5
    """periods | so many of the strongest periods of a residual are tried with an effect's own columns | a choice: more
    would be chance"""
    trials: int = 3
    """values | so many of the tried values of an effect's constants, the best ones, become candidates | a choice: the
    period, its double, and one more peak"""
    min_rows: int = 12
    """rows | in fewer rows no period is looked for | a choice: a sine beside a parabola has five numbers and its
    period, and twice as many rows test them"""
    min_turns: float = 2.0
    """turns | a period must fit so many times into the range of its quantity to be found in a residual | a choice: over
    less, a sine is hardly told from what is slow along the quantity"""
    max_turns: float = 5000.0
    """turns | and not more often | a choice: it bounds the search; 5000 turns are a pitch of 0.1 mm on 500 mm"""
    neighbour_turns: float = 0.25
    """turns over the range of the quantity | periods that differ by so much are neighbours, between which a period is
    refined; and the rows must cover a turn but for so much of it, or the effect cannot be tested | at a quarter of a
    turn a period fits half as well at best"""
    slow_degree: int = 2
    """degree of a polynomial | what is slow along the quantity is taken away before periods are looked for | a choice:
    a slope and a bend are another cause's"""
    outlier_sigmas: float = 4.0
    """robust standard deviations | a value farther out counts as one there: it would be noise at every frequency | a
    normal error is as large once in 16,000"""
    image_window: float = 0.9
    """spectral window, rms over the series | from here on frequencies are images of one another, and those above half
    of it are not searched | a choice: 0.81 of the square of a sine shows at its image"""
    image_multiples: int = 5
    """multiples | so many multiples of an image's frequency must be images, too, for an even grid of values | a choice:
    images of a few sessions, far apart, fade before"""
    chance: float = 0.01
    """probability | by less chance than this a searched period may contradict the period of the machine's description |
    a choice: the description is right in most cases"""


# Frequencies per 1 / span: the power between two of them is at least 0.95 of a peak's (sinc(1/8)^2).
OVERSAMPLING = 4
# A peak has side lobes (4.7 and 1.6 % of it, 1.4 and 2.5 / span away on even rows): so many times 1 / span about a
# peak, lower ones are not peaks of their own.
LOBES = 3
# A quantity that changes less does not change.
MIN_SPAN = 1e-300
# Values of a finer grid about a peak, on which it is refined: the phase at the ends is then right within 3 degrees.
REFINED = 33
# A sine and a cosine of which so little is left beside each other and a constant (1 on even rows) explain nothing.
MIN_DETERMINANT = 1e-3

_Complex = NDArray[np.complex64]


class PeriodLimits(NamedTuple):
    """Which periods are searched.

    shortest, longest : in the unit of the quantity.
    fewest_turns : a period must fit so many times into the span of the quantity.
    most_turns : and not more often.
    """

    shortest: float
    longest: float
    fewest_turns: float = PeriodCriteria.min_turns
    most_turns: float = PeriodCriteria.max_turns


class PeriodSearch(NamedTuple):
    """The strongest periods, and among how many of them they are.

    periods : in the unit of the quantity, the strongest first; none where the rows resolve none.
    explained : mean square that a sine of each explains, summed over the series.
    independent : number of searched frequencies that do not resemble one another: their range times the span.
    """

    periods: tuple[float, ...]
    explained: tuple[float, ...]
    independent: int


def strongest_periods(
    quantity: FloatArray,
    series: FloatArray,
    limits: PeriodLimits,
    count: int = PeriodCriteria.peaks,
    criteria: PeriodCriteria = PeriodCriteria(),
) -> PeriodSearch:
    """The periods in `quantity` (N, S), or (N, 1) for all series, that explain most of `series` (N, S).

    One period for all series, an amplitude and a phase for each. Only peaks of the spectrum inside the limits count.
    """
    span = float(np.ptp(quantity, axis=0).max()) if len(quantity) else 0.0
    if not span > 0:
        return PeriodSearch((), (), 0)
    first = max(1.0 / limits.longest, limits.fewest_turns / span)
    step = 1.0 / (OVERSAMPLING * span)
    last = min(1.0 / limits.shortest, limits.most_turns / span)
    size = int((last - first) / step) + 1
    if size < 3:
        return PeriodSearch((), (), 0)
    y = _without_slow(quantity, series, criteria)
    explained, window = _spectrum(quantity, y, first, step, size)
    image = _first_image(quantity, window, first, step, criteria)
    if image is not None:
        size = min(size, max(int((image / 2 - first) / step) + 1, 0))
    frequencies = first + step * _peaks(explained[:size], int(LOBES / (span * step)), count)
    refined = sorted((_refined(quantity, y, peak, step) for peak in frequencies.tolist()), key=lambda peak: -peak[1])
    return PeriodSearch(
        tuple(1.0 / frequency for frequency, _ in refined),
        tuple(square for _, square in refined),
        int(np.ceil(size * step * span)),
    )


def shortest_period(quantity: FloatArray, shortest: float, criteria: PeriodCriteria = PeriodCriteria()) -> float:
    """The shortest period, down to `shortest`, that the values of a quantity (N, S) tell from its images.

    Values on an even grid tell none below twice its distance; 0 where no values are on one.
    """
    span = float(np.ptp(quantity, axis=0).max()) if len(quantity) else 0.0
    if not span > 0:
        return 0.0
    # half of an image's frequency counts: images are looked for to twice the highest frequency
    first, step = 1.0 / span, 1.0 / (OVERSAMPLING * span)
    size = int((min(2.0 / shortest, criteria.max_turns / span) - first) / step) + 1
    if size < 1:
        return 0.0
    _, window = _spectrum(quantity, np.zeros((len(quantity), 0)), first, step, size)
    image = _first_image(quantity, window, first, step, criteria)
    return 0.0 if image is None else 2.0 / image


def _without_slow(quantity: FloatArray, series: FloatArray, criteria: PeriodCriteria) -> FloatArray:
    """The series (N, S) without a parabola in their quantity, about their means; outliers held before and after."""
    y = _outliers_held(series, criteria.outlier_sigmas)
    for k in range(y.shape[1]):
        q = quantity[:, min(k, quantity.shape[1] - 1)]
        powers = np.vander((q - q.mean()) / max(float(np.ptp(q)), MIN_SPAN), criteria.slow_degree + 1)
        y[:, k] -= powers @ solve_least_squares(powers, y[:, k])
    y = _outliers_held(y, criteria.outlier_sigmas)
    return np.asarray(y - y.mean(axis=0))


def _outliers_held(series: FloatArray, sigmas: float) -> FloatArray:
    """The series (N, S) about their medians; a value beyond so many standard deviations counts as one there."""
    y = series - np.median(series, axis=0)
    limit = sigmas * robust_sigma(y)
    return np.asarray(np.clip(y, -limit, limit))


def _peaks(explained: FloatArray, apart: int, count: int) -> IntArray:
    """Places of the `count` highest local maxima, the highest first; none is nearer than `apart` to a higher one."""
    inner = explained[1:-1]
    places = 1 + np.flatnonzero((inner >= explained[:-2]) & (inner > explained[2:]))
    chosen: list[int] = []
    for place in places[np.argsort(-explained[places], kind="stable")].tolist():
        if len(chosen) < count and all(abs(place - higher) > apart for higher in chosen):
            chosen.append(place)
    return np.array(chosen, dtype=np.int64)


def _first_image(
    quantity: FloatArray, window: FloatArray, first: float, step: float, criteria: PeriodCriteria
) -> float | None:
    """The first frequency at which the spectral window shows images; None where there is none.

    Below 1 / span, where the window falls from 1, there is none. The images of an even grid come again at every
    multiple; those of a few sessions, far apart, fade.
    """
    last = first + step * (len(window) - 1)
    places = np.flatnonzero(window > criteria.image_window)
    for frequency in (first + step * places[first + step * places > OVERSAMPLING * step]).tolist():
        nearby: FloatArray = np.asarray(frequency + np.linspace(-step, step, REFINED))
        image = float(nearby[np.argmax(_window(quantity, nearby))])
        multiples: FloatArray = np.asarray(np.arange(1, criteria.image_multiples + 1) * image)
        if (_window(quantity, multiples[multiples <= last + step]) > criteria.image_window).all():
            return image
    return None


def _window(quantity: FloatArray, frequencies: FloatArray) -> FloatArray:
    """The spectral window at some frequencies (F,): the rms over the series of |mean exp(2 pi i f q)|."""
    phase_rad = 2 * np.pi * frequencies[:, None, None] * quantity
    return np.asarray(np.sqrt(np.mean(np.abs(np.mean(np.exp(1j * phase_rad), axis=1)) ** 2, axis=1)))


def _refined(quantity: FloatArray, y: FloatArray, frequency: float, step: float) -> tuple[float, float]:
    """The best frequency within a step of this one, and what it explains."""
    fine = 2 * step / (REFINED - 1)
    explained, _ = _spectrum(quantity, y, frequency - step, fine, REFINED)
    best = int(np.argmax(explained))
    return frequency - step + best * fine, float(explained[best])


def _spectrum(
    quantity: FloatArray, y: FloatArray, first: float, step: float, size: int
) -> tuple[FloatArray, FloatArray]:
    """At each of `size` frequencies: the mean square explained, summed over the series; and the spectral window.

    y : (N, S) of mean 0.  The window is the rms over the series of |mean exp(2 pi i f q)|.
    """
    explained, window = np.zeros(size), np.zeros(size)
    for k in range(quantity.shape[1]):
        coarse, fine = _phase_factors(quantity[:, k], first, step, size)
        mean = _sums(coarse, fine, None, size) / len(y)
        double = _sums(coarse * coarse, fine * fine, None, size) / len(y)
        window += np.abs(mean) ** 2 / quantity.shape[1]
        # mean squares and product of cosine and sine about their means
        cc = (1 + double.real) / 2 - mean.real**2
        ss = (1 - double.real) / 2 - mean.imag**2
        cs = double.imag / 2 - mean.real * mean.imag
        determinant = cc * ss - cs**2
        usable = determinant > MIN_DETERMINANT
        for values in y.T if quantity.shape[1] == 1 else y.T[k : k + 1]:
            product = _sums(coarse, fine, values, size) / len(y)
            yc, ys = product.real, product.imag
            power = ss * yc**2 + cc * ys**2 - 2 * cs * yc * ys
            explained += np.divide(power, determinant, out=np.zeros(size), where=usable)
    return explained, np.sqrt(window)


def _phase_factors(quantity: FloatArray, first: float, step: float, size: int) -> tuple[_Complex, _Complex]:
    """(A, N) and (B, N) factors whose products are exp(2 pi i f q) at A B >= size frequencies."""
    width = int(np.ceil(np.sqrt(size)))
    turns = quantity - quantity.mean()
    coarse = np.outer(first + step * width * np.arange(-(-size // width)), turns)
    fine = np.outer(step * np.arange(width), turns)
    return _unit_circle(coarse), _unit_circle(fine)


def _unit_circle(turns: FloatArray) -> _Complex:
    """exp(2 pi i turns); whole turns are taken off in double precision."""
    phase_rad = (2 * np.pi * (turns - np.rint(turns))).astype(np.float32)
    return np.asarray(np.cos(phase_rad) + np.complex64(1j) * np.sin(phase_rad))


def _sums(coarse: _Complex, fine: _Complex, values: FloatArray | None, size: int) -> NDArray[np.complex128]:
    """(size,) sum over rows of the factors' products, times `values` (N,) where given."""
    weighted = coarse if values is None else coarse * values.astype(np.float32)
    return np.asarray((weighted @ fine.T).ravel()[:size], dtype=np.complex128)
