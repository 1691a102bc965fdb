"""Numbers that devices send in place of a value, where a channel states no range that says otherwise."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from compd.gauge import OptionDoubt, Quality, Reading, bad

# Data loggers and gateways write -9999, -99999 ... for a value that is missing.
_MISSING = frozenset(float(1 - 10**digits) for digits in range(4, 10))
# Of whole numbers whose type is not known on the wire.
FULL_SCALE = frozenset(
    float(word) for bits in (16, 32, 64) for word in ((1 << bits) - 1, (1 << bits - 1) - 1, -(1 << bits - 1))
)
# A full-scale word of fewer bits, such as those of a byte, is an ordinary number.
MIN_BITS = 12


def full_scale(bits: int, signed: bool) -> frozenset[float]:
    """The full-scale words of a whole number of so many bits, as numbers; none for fewer than MIN_BITS bits."""
    if bits < MIN_BITS:
        return frozenset()
    words = ((1 << bits - 1) - 1, -(1 << bits - 1)) if signed else ((1 << bits) - 1,)
    return frozenset(map(float, words))


def unless_missing(reading: Reading, number: float, words: Collection[float], range_key: str) -> Reading:
    """The reading; without a value where the number on the wire is a full-scale word or stands for a missing value.

    number : on the wire, unscaled. words : the full-scale words of its type. range_key : what states a range.
    """
    if not reading.ok:
        return reading
    if number in words:
        quality, what = Quality.OVER_RANGE if number > 0 else Quality.UNDER_RANGE, "is full scale"
    elif number in _MISSING:
        quality, what = Quality.SENSOR_FAULT, "stands for a missing value"
    else:
        return reading
    return bad(reading.time_s, quality, f"raw value {number:.0f} {what}, unless {range_key} of the channel contains it")


def range_doubts(without: Sequence[str], range_key: str, location: tuple[str | int, ...]) -> Iterator[OptionDoubt]:
    """The doubt about channels that state no range. without : their names. range_key : what states one; "" for none."""
    if without and range_key:
        yield OptionDoubt(
            location,
            "no range is stated: what a device sends for no value may be taken for one",
            ", ".join(without),
            f"write {range_key} from the sensor's data sheet, in the channel's own unit",
        )
