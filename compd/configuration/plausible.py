"""Plausible values of a configuration: one table, with the reason of every limit.

A value beyond is no error, for there are machines of all sizes; `compd check` and `compd run` warn of it. It is most
often a slip of the unit or of the decimal point, and it would let a fault pass that compd could have found.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from compd.documents import Document, Location
from compd.errors import Problem
from compd.gauge import GaugeOptions

# Smallest size (mm) of a machine: if all coordinates of a list are below it, they are probably in metres.
_MIN_MACHINE_MM = 5.0
_MAX_MACHINE_MM = 1e5
# Longest rotation vector (rad): pi, rounded up.
_PI = 3.15
_DEGREES = "a rotation vector is no longer than pi. In degrees?"


class PlausibleRange(NamedTuple):
    """Plausible range of one key. key : dotted; `*` stands for any name or entry. reason : of the exceeded limit."""

    key: str
    lowest: float
    highest: float
    unit: str
    too_low: str
    too_high: str


PLAUSIBLE: tuple[PlausibleRange, ...] = (
    PlausibleRange(
        "loop.rate_hz", 5, 2000, "Hz",
        "a machine at 50 mm/s moves 10 mm and more from one correction to the next",
        "comparators are read 10 to 500 times a second: more cycles compute the same again",
    ),
    PlausibleRange(
        "loop.stale_after_s", 0.005, 5, "s",
        "a gauge is read every 5 to 50 ms: its readings would be stale as they come",
        "a reading that old still counts as good, whatever the machine has done since",
    ),
    PlausibleRange(
        "loop.hold_s", 0.01, 600, "s",
        "too short for a line to be opened again: this is `on_stale: stop`",
        "joints and frame drift by micrometres in ten minutes, and the correction would be held for longer",
    ),
    PlausibleRange(
        "limits.correction_mm", 0.001, 5, "mm",
        "every correction of more than 1 um would be clamped",
        "joints, links and frame are wrong by hundredths of mm: this limit would stop no wrong correction",
    ),
    PlausibleRange(
        "limits.slew_mm_per_s", 0.001, 100, "mm/s",
        "a correction of 0.1 mm would take minutes",
        "corrections change by micrometres a second: this limit would stop no jump",
    ),
    PlausibleRange(
        "limits.tip_error_um", 0.05, 20_000, "um",
        "gauges scatter by more: no setpoint would be valid",
        "a tip that is wrong by centimetres would be valid",
    ),
    PlausibleRange(
        "sockets.valid_for_s", 0.002, 2, "s",
        "a setpoint would have ended before it arrives",
        "a controller could use the last setpoint of a dead daemon for this time",
    ),
    PlausibleRange(
        "sockets.target.valid_for_s", 0.05, 60, "s",
        "a controller would have to send its target many times a second",
        "a hanging controller keeps the machine at its last target for this time",
    ),
    PlausibleRange(
        "lines.*.timeout_s", 0.005, 5, "s",
        "devices take 1 to 100 ms to answer: good replies would come too late",
        "one lost reply keeps all gauges of the line waiting for this time",
    ),
    PlausibleRange(
        "lines.*.back_off_s.*", 0.01, 60, "s",
        "a line that is gone would be opened without a pause",
        "a cable that is plugged in again would be found only after that time",
    ),
    PlausibleRange(
        "lines.*.baud", 110, 1_000_000, "baud",
        "slower than a teleprinter", "no gauge on RS-232 or RS-485 is so fast",
    ),
    PlausibleRange("lines.*.pause_s", 0, 1, "s", "", "devices are deaf for milliseconds after a reply"),
    PlausibleRange("lines.*.poll_every_s", 0, 60, "s", "", "readings would be a minute old and more"),
    PlausibleRange(
        "gauges.*.stale_after_s", 0.005, 600, "s",
        "a gauge is read every 5 to 50 ms: its readings would be stale as they come",
        "a reading that old still counts as good; even a temperature changes in ten minutes",
    ),
    PlausibleRange(
        "gauges.*.restart_s", 0.05, 60, "s",
        "one lost reply would need a person: no display restarts in 50 ms",
        "a display that restarts in this time would be believed with any count that its limits of motion allow",
    ),
    PlausibleRange(
        "gauges.*.noise_um", 0.0005, 50, "um",
        "no length gauge of a workshop repeats to half a nanometre",
        "a comparator this noisy corrects nothing",
    ),
    PlausibleRange(
        "gauges.*.fastest_mm_per_s", 0.001, 5000, "mm/s",
        "not even thermal expansion would be believed after a pause",
        "no link moves that fast: this limit would find no jump",
    ),
    PlausibleRange(
        "gauges.*.acceleration_mm_per_s2", 1, 50_000, "mm/s2",
        "no drive is that slow; in m/s2? then multiply it by 1000",
        "five times gravity: this limit would find no jump",
    ),
    PlausibleRange(
        "votes.standing_scale_mm", 0.01, 100, "mm",
        "scales scatter, and a machine at rest would be taken for one that moves",
        "a scale that is stuck would be found only after such a way",
    ),
    PlausibleRange(
        "votes.following_mm", 0.002, 5, "mm",
        "drives follow to micrometres: good scales would be named",
        "a scale that is wrong by as much would pass",
    ),
    PlausibleRange(
        "votes.joint_pair_um", 0.5, 200, "um",
        "the play of an axis is larger: good comparators would be named",
        "ball shanks err by micrometres: a comparator that drifts would pass",
    ),
    PlausibleRange(
        "votes.tip_mm_per_s", 1, 5000, "mm/s",
        "no machine is that slow: good gauges would be named",
        "no tip moves that fast: nothing would be found",
    ),
    PlausibleRange(
        "votes.frame.tolerance_um", 0.5, 500, "um",
        "thermometers and rods are not that good: good comparators would be named",
        "a comparator that drifts by as much would pass",
    ),
    PlausibleRange(
        "geometry.link_length_mm.*", 20, 20_000, "mm", "shorter than its own joints", "longer than any machine's"
    ),
    PlausibleRange("geometry.base.rotation_B0_in_M_rad.*", -_PI, _PI, "rad", _DEGREES, _DEGREES),
    PlausibleRange("geometry.tool.zero_rotation_P_in_M_rad.*", -_PI, _PI, "rad", _DEGREES, _DEGREES),
    PlausibleRange("geometry.plate_thickness_mm", 2, 5000, "mm", "a sheet is no surface plate", "no plate is so thick"),
    PlausibleRange(
        "geometry.scale_signal_period_mm", 1e-4, 10, "mm",
        "the finest scales have 128 nm",
        "the coarsest magnetic scales have 5 to 10 mm",
    ),
    PlausibleRange(
        "geometry.platform.weight_N", 0.1, 1e5, "N", "no platform with its joints weighs less", "ten tons"
    ),
)  # fmt: skip

# Lists of points, with the least distance (mm) of the farthest one from the origin.
_POINTS: tuple[Location, ...] = (
    ("geometry", "base", "supports_B_mm"),
    ("geometry", "base", "joints_B_mm"),
    ("geometry", "platform", "joints_P_mm"),
    ("geometry", "plate_points_M_mm"),
)


def implausible(
    document: Document, sections: Mapping[str, Any], gauges: Mapping[str, GaugeOptions]
) -> Iterator[Problem]:
    """A warning for every probable slip. sections : the readable ones."""
    values = {**sections, "gauges": gauges}
    for plausible in PLAUSIBLE:
        for location, value in _values(values, plausible.key.split("."), ()):
            if (problem := _out_of_range(plausible, location, value, document)) is not None:
                yield problem
    yield from _points_out_of_scale(document, sections)
    yield from _times_that_do_not_fit(document, sections)


def _out_of_range(plausible: PlausibleRange, location: Location, value: float, document: Document) -> Problem | None:
    if plausible.lowest <= value <= plausible.highest:
        return None
    reason = plausible.too_low if value < plausible.lowest else plausible.too_high
    allowed = f"{plausible.lowest:g} to {plausible.highest:g} {plausible.unit} as a rule"
    next_step = "mend it, or ignore this where the machine is so"
    if plausible.unit == "mm" and plausible.lowest <= value * 1e3 <= plausible.highest and value < plausible.lowest:
        next_step = f"in metres? then write {value * 1e3:g}"
    return Problem(
        document.where(location),
        f"is not plausible: {reason}",
        value=f"{value:g} {plausible.unit}",
        allowed=allowed,
        next_step=next_step,
    )


def _points_out_of_scale(document: Document, sections: Mapping[str, Any]) -> Iterator[Problem]:
    for location in (*_POINTS, *_tool_points(sections)):
        points = [value for _, value in _values(sections, [*map(str, location), "*", "*"], ())]
        points = points or [value for _, value in _values(sections, [*map(str, location), "*"], ())]
        largest_mm = max(map(abs, points), default=math.nan)
        if 0 < largest_mm < _MIN_MACHINE_MM:
            yield Problem(
                document.where(location),
                "is not plausible: no coordinate is larger than a few millimetres",
                value=f"at most {largest_mm:g} mm",
                next_step="in metres? then multiply every number by 1000",
            )
        elif largest_mm > _MAX_MACHINE_MM:
            yield Problem(
                document.where(location),
                "is not plausible: no machine is a hundred metres large",
                value=f"{largest_mm:g} mm",
                next_step="all lengths are in mm",
            )


def _tool_points(sections: Mapping[str, Any]) -> Iterator[Location]:
    """Points that may lie at an origin, but not close to it: the base's origin, or the tip at machine zero."""
    yield ("geometry", "base", "origin_B0_in_M_mm")
    tool = getattr(sections.get("geometry"), "tool", None)
    if getattr(tool, "on", None) == "platform":
        yield ("geometry", "tool", "zero_tip_M_mm")


def _times_that_do_not_fit(document: Document, sections: Mapping[str, Any]) -> Iterator[Problem]:
    """Times that are plausible alone, but contradict others."""
    rate_hz = _value(sections, "loop", "rate_hz")
    valid_for_s = _value(sections, "sockets", "valid_for_s")
    if rate_hz and valid_for_s and valid_for_s * rate_hz < 2:
        yield Problem(
            document.where(("sockets", "valid_for_s")),
            "is not plausible: a setpoint ends before the next one comes",
            value=f"{valid_for_s:g} s, one every {1 / rate_hz:g} s",
            allowed=f"{2 / rate_hz:g} s or more",
            next_step="write five periods or more",
        )

    for name, line in (sections.get("lines") or {}).items():
        back_off_s = getattr(line, "back_off_s", None)
        if back_off_s is not None and back_off_s[0] > back_off_s[1]:
            yield Problem(
                document.where(("lines", name, "back_off_s")),
                "is not plausible: the first wait is the longest",
                value=f"{list(back_off_s)} s",
                next_step="write the first wait, then the longest",
            )


def _value(sections: Mapping[str, Any], section: str, key: str) -> float | None:
    value: float | None = getattr(sections.get(section), key, None)
    return value


def _values(value: Any, keys: Sequence[str], location: Location) -> Iterator[tuple[Location, float]]:
    """Every number at a dotted key, in which `*` stands for any name or entry, with its location in the file."""
    if not keys:
        if isinstance(value, int | float) and math.isfinite(value):
            yield location, value
        return
    key, *rest = keys
    if key == "*":
        parts: Iterator[tuple[str | int, Any]] = iter(())
        if isinstance(value, Mapping):
            parts = iter(value.items())
        elif isinstance(value, list | tuple):
            parts = iter(enumerate(value))
        for name, part in parts:
            yield from _values(part, rest, (*location, name))
    else:
        part = value.get(key) if isinstance(value, Mapping) else getattr(value, key, None)
        yield from _values(part, rest, (*location, key))
