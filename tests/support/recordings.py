"""Small recordings for tests, written as a person's spreadsheet would write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

SIDECAR = """\
machine: tripod-cmm
reference:
  quantity: tool_position
  frame: machine
  sigma_um: 0.15
"""
HEADER = (
    ["time_s", "session", "visit"]
    + [f"scale_{i}_mm" for i in (1, 2, 3)]
    + [f"joint_{k}_um" for k in range(1, 10)]
    + [f"frame_{d}_um" for d in ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6")]
    + ["temperature_room_degC", "pressure_hPa"]
    + [f"reference_{axis}_mm" for axis in "xyz"]
)
# Turns the text of a CSV file into another.
Edit = Callable[[str], str]


def csv_text(rows: int = 20, separator: str = ",") -> str:
    """`rows` rows of a tripod under HEADER, two of each visit: row r (spreadsheet) has time_s = 10 (r - 2)."""
    rng = np.random.default_rng(7)
    lines = [separator.join(HEADER)]
    scales_mm = np.zeros(3)
    for i in range(rows):
        cells = [str(10 * i), str(1 + i // 10), str(i // 2)]
        drawn_mm = rng.uniform(-60, 60, 3)
        scales_mm = scales_mm if i % 2 else drawn_mm
        cells += [f"{value:.6f}" for value in scales_mm]
        cells += [f"{value:.2f}" for value in rng.uniform(-9, 9, 18)]
        cells += ["20.104", "1013.25"]
        cells += [f"{value:.6f}" for value in rng.uniform(60, 90, 3)]
        lines.append(separator.join(cells))
    return "\n".join(lines) + "\n"


def write_recording_files(tmp_path: Path, text: str | bytes, sidecar: str = SIDECAR) -> Path:
    """Write run.csv and its sidecar into `tmp_path`; the CSV's path."""
    path = tmp_path / "run.csv"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    path.with_suffix(".yaml").write_text(sidecar)
    return path


def set_cell(row: int, column: str, value: str) -> Edit:
    """An edit that writes `value` into spreadsheet row `row` (header = 1) of `column`."""

    def edit(text: str) -> str:
        lines = text.split("\n")
        cells = lines[row - 1].split(",")
        cells[HEADER.index(column)] = value
        lines[row - 1] = ",".join(cells)
        return "\n".join(lines)

    return edit


def set_column(name: str, value: str) -> Edit:
    """An edit that writes `value` into every row of `name`."""

    def edit(text: str) -> str:
        for row in range(2, text.count("\n") + 1):
            text = set_cell(row, name, value)(text)
        return text

    return edit


def drop_columns(*names: str) -> Edit:
    """An edit that leaves columns out."""

    def edit(text: str) -> str:
        rows = [line.split(",") for line in text.splitlines()]
        keep = [i for i, name in enumerate(rows[0]) if name not in names]
        return "\n".join(",".join(cells[i] for i in keep) for cells in rows) + "\n"

    return edit


def rename_column(old: str, new: str) -> Edit:
    """An edit that renames one column."""
    return lambda text: text.replace(old, new, 1)
