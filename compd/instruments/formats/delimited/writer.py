"""Delimited text: with commas and a point, with ISO stamps, or with semicolons, a decimal comma and German stamps."""

from __future__ import annotations

from compd.instruments.samples import Samples

# To the microsecond and to a nanometre, a nanoradian.
_TIME_DECIMALS = 6
_DECIMALS = {"m": 9, "rad": 9}
_VALUE_DECIMALS = 6


def write_csv(samples: Samples) -> bytes:
    """Commas, a decimal point, time_s in seconds on the instrument's clock; LF."""
    times = None if samples.time_s is None else [f"{time:.{_TIME_DECIMALS}f}" for time in samples.time_s.tolist()]
    return _text(samples, "time_s", times, ",", "\n")


def write_iso(samples: Samples) -> bytes:
    """Commas, a decimal point, and ISO 8601 stamps to the millisecond; LF."""
    stamps = samples.stamps()
    times = None if stamps is None else [stamp.isoformat(timespec="milliseconds") for stamp in stamps]
    return _text(samples, "time", times, ",", "\n")


def write_german(samples: Samples) -> bytes:
    """Semicolons, a decimal comma, stamps like 22.11.2026 16:56:08,250, CR LF and a byte order mark."""
    stamps = samples.stamps()
    times = None
    if stamps is not None:
        times = [f"{stamp:%d.%m.%Y %H:%M:%S},{stamp.microsecond // 1000:03d}" for stamp in stamps]
    return b"\xef\xbb\xbf" + _text(samples, "Zeit", times, ";", "\r\n")


def _text(samples: Samples, time_name: str, times: list[str] | None, delimiter: str, end: str) -> bytes:
    header = samples.header(time_name if times is not None else "")
    units = [name.rpartition("_")[2] for name in header[-len(samples.axes) :]]
    decimals = [_DECIMALS.get(unit, _VALUE_DECIMALS) for unit in units]
    if delimiter == ";":
        header = [*header[: -len(units)], *(f"{axis} [{unit}]" for axis, unit in zip(samples.axes, units, strict=True))]
    lines = [delimiter.join(header)]
    for k, row in enumerate(samples.written_values.tolist()):
        numbers = [f"{value:.{places}f}" for value, places in zip(row, decimals, strict=True)]
        if delimiter == ";":
            numbers = [number.replace(".", ",") for number in numbers]
        cells = [
            *([times[k]] if times is not None else []),
            *([samples.names[k]] if samples.names is not None else []),
            *numbers,
        ]
        lines.append(delimiter.join(cells))
    return (end.join(lines) + end).encode()
