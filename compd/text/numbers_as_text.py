"""Numbers as people read them: as many digits as count, the unit behind, no powers of ten where they can be avoided.

Example::

    >>> number_text(0.1234, "um"), fall_text([105.0, 55.2], "um"), percent_text(0.9984)
    ('0.12 um', '105 -> 55 um', '99 %')
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

# Digits that a person reads, and the most that tell two neighbouring numbers apart.
DIGITS = 2
MAX_DIGITS = 4
# Between these a number is written without a power of ten.
SMALLEST, LARGEST = 1e-4, 1e7
# Least digits of a length in mm.
_MM_DIGITS = 3
UM_PER_MM = 1e3


def number_text(value: float, unit: str = "", digits: int = DIGITS) -> str:
    """A number with so many digits that count: "0.12 um", "113 um"; "not known" for nan.

    A length in um of a millimetre or more is written in mm, with three digits at least: "154 mm".
    """
    if math.isnan(value):
        return "not known"
    if unit == "um" and _is_in_mm(value):
        return number_text(value / UM_PER_MM, "mm", max(digits, _MM_DIGITS))
    return f"{_digits(value, digits)}{_behind(unit)}"


def fall_text(values: Sequence[float], unit: str) -> str:
    """Numbers one after the other, with digits enough to tell neighbours apart: "105 -> 55 um"."""
    if unit == "um" and any(map(_is_in_mm, values)):
        return " -> ".join(number_text(value, unit) for value in values)
    for digits in range(DIGITS, MAX_DIGITS + 1):
        texts = [number_text(value, digits=digits) for value in values]
        if all(before != after for before, after in pairwise(texts)):
            return " -> ".join(texts) + _behind(unit)
    return " -> ".join(number_text(value) for value in values) + _behind(unit)


def estimate_text(value: float, std: float, unit: str = "") -> str:
    """A number with its standard error, of which two digits count: "1.113 +- 0.021 ppm/K"."""
    if not math.isfinite(std) or std <= 0:
        return f"{_digits(value, DIGITS + 1)}{_behind(unit)} (standard error not known)"
    decimals = max(0, DIGITS - 1 - math.floor(math.log10(std)))
    if std < SMALLEST or abs(value) >= LARGEST:
        return f"{value:.4g} +- {std:.2g}{_behind(unit)}"
    return f"{value:.{decimals}f} +- {std:.{decimals}f}{_behind(unit)}"


def estimates_text(values: Sequence[float], std: float, unit: str = "", between: str = ", ") -> str:
    """Several numbers with one standard error: "0.884, 1.103, 0.795 (+- 0.020) um".  between : what stands there."""
    if not math.isfinite(std) or not SMALLEST <= std < LARGEST:
        return between.join(_digits(value, DIGITS + 1) for value in values) + _behind(unit)
    decimals = max(0, DIGITS - 1 - math.floor(math.log10(std)))
    shown = between.join(f"{value:.{decimals}f}" for value in values)
    return f"{shown} (+- {std:.{decimals}f}){_behind(unit)}"


def percent_text(share: float) -> str:
    """A share, 0 to 1, in per cent; never rounded up to all or down to nothing: "99 %", "below 1 %"."""
    if math.isnan(share):
        return "not known"
    percent = 100 * min(max(share, 0.0), 1.0)
    if 0 < percent < 1:
        return "below 1 %"
    return f"{99 if 99 < percent < 100 else percent:.0f} %"


def chance_text(p_value: float) -> str:
    """A probability as people bet: 0.001 is "1 time in 1000"; "" where it is not known."""
    if not p_value > 0:
        return ""
    return f"1 time in {number_text(1 / p_value, digits=1 if p_value > 0.05 else DIGITS)}"


def join_words(words: Sequence[str], word: str = "and") -> str:
    """Words as a sentence has them: "a, b and c"."""
    return f" {word} ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)


def _is_in_mm(um: float) -> bool:
    return math.isfinite(um) and abs(um) >= UM_PER_MM


def _behind(unit: str) -> str:
    return f" {unit}" if unit not in ("", "1") else ""


def _digits(value: float, digits: int) -> str:
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    if not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{digits}g}"
    # rounded first: 99.6 with two digits is 100, which needs none behind the point
    rounded = float(f"{value:.{digits}g}")
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{decimals}f}"
