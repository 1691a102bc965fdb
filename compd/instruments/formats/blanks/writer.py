"""Columns between blanks: x y z without header and without time, as controllers of trackers stream them."""

from __future__ import annotations

from compd.instruments.samples import Samples


def write_blanks(samples: Samples) -> bytes:
    """Numbers in columns of fixed width, a name before them where points have one; nothing says unit, rate or axes."""
    names = [""] * len(samples.values) if samples.names is None else [f"{name:<10s} " for name in samples.names]
    rows = samples.written_values.tolist()
    lines = [name + " ".join(f"{value:14.6f}" for value in row) for name, row in zip(names, rows, strict=True)]
    return ("\n".join(lines) + "\n").encode()
