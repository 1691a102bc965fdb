"""Renishaw CARTO `.rtx`, in the shape of its description; no file of an instrument was tried."""

from __future__ import annotations

from compd.instruments.samples import Samples


def write_carto(samples: Samples) -> bytes:
    """One length at a constant rate, in `samples.unit`, of which the file says nothing.

    The samples are lengths at equal distances in time.
    """
    count, rate_hz = len(samples.values), samples.rate_hz
    date = "" if samples.start is None else f"{samples.start:%d/%m/%Y %H:%M:%S}"
    header = [
        "HEADER::",
        "Owner: compd",
        "Version no: 1",
        "File Type: Dynamic",
        "Velocity: 0",
        f"Sample rate: {rate_hz:.10g}",
        f"Sample no: {count}",
        "Trigger point: 0",
        "Trigger interval: 0",
        f"Actual sample rate: {rate_hz:.10g}",
        "TITLE::",
        "Machine: simulated",
        "Serial No: 0",
        f"Date: {date}",
        "By: compd",
        "Axis: Z",
        "Location: ",
        "Flags: 0 0 0 0",
        "Data:",
    ]
    text = "".join(f"{line}\r\n" for line in header).encode("ascii")
    return text + samples.written_values[:, 0].astype("<f8").tobytes() + b"EOF::\r\n"
