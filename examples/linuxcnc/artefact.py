"""A calibrated artefact in the simulated machine: the program that probes it, and the resulting recording."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from compd.arrays import FloatArray
from compd.recording import sidecar_contents, write_recording
from motion_log import MotionSample

# Calibrated corners in {M}, mm, each outermost in x, y and z: the three faces that meet there are probed.
CORNERS_mm = (
    (60.0, 0.0, 300.0),
    (10.0, 60.0, 315.0),
    (-50.0, 35.0, 290.0),
    (-45.0, -40.0, 325.0),
    (20.0, -60.0, 295.0),
    (0.0, 0.0, 340.0),
)
# Distance (mm) from the corner, along x, y and z, at which the gauges are read without a touch.
CLEAR_mm = 0.5
# Uncertainty (um) of a probed place: the path of one servo period, plus the gauges' noise.
SIGMA_um = 0.3
# Height (mm) of the tip between corners, above all of them.
ABOVE_mm = 350.0

_SUBPROGRAMS = """\
(The faces of calibrated corners, found by touch with the corrections on: where the probe trips is where the)
(controller believes the face to be. Half a millimetre outside of each corner, gauges are read at rest.)
G21 G90 G17 G94 G61
o<face> sub
  (#1 to #3: a place 1 mm outside of the face. #4 to #6: its normal)
  G1 X#1 Y#2 Z#3 F1200
  M64 P1
  G38.2 X[#1-#4*2] Y[#2-#5*2] Z[#3-#6*2] F90
  M65 P1
  G1 X[#5061+#4*0.1] Y[#5062+#5*0.1] Z[#5063+#6*0.1] F90
  M64 P1
  G38.2 X[#1-#4*2] Y[#2-#5*2] Z[#3-#6*2] F10
  M65 P1
  #<_found> = [#5061*#4+#5062*#5+#5063*#6]
  G1 X#1 Y#2 Z#3 F600
o<face> endsub
o<corner> sub
  (#1 to #3: the corner. The places on its faces are 3 mm from the other two.)
  G1 X[#1-3] Y[#2-3] Z[#3+1] F1200
  o<face> call [#1-3] [#2-3] [#3+1] [0] [0] [1]
  #<z> = #<_found>
  G1 X[#1+1] Z[#3+1]
  o<face> call [#1+1] [#2-3] [#3-3] [1] [0] [0]
  #<x> = #<_found>
  G1 Y[#2+1]
  o<face> call [#1-3] [#2+1] [#3-3] [0] [1] [0]
  #<y> = #<_found>
"""


def probing_program(corners_mm: Sequence[Sequence[float]] = CORNERS_mm) -> str:
    """G-code that probes every corner once, and marks (digital output 0) when gauges are to be read."""
    lines = [
        _SUBPROGRAMS,
        f"  G1 X[#<x>+{CLEAR_mm}] Y[#<y>+{CLEAR_mm}] Z[#<z>+{CLEAR_mm}] F300\n"
        "  G4 P0.5\n  M64 P0\n  G4 P0.8\n  M65 P0\n"
        f"  G1 Z{ABOVE_mm} F1200\n"
        "o<corner> endsub\n",
        f"G1 Z{ABOVE_mm} F1200\n",
    ]
    for x, y, z in corners_mm:
        lines += [f"G1 X{x} Y{y} F1200\n", f"o<corner> call [{x}] [{y}] [{z}]\n"]
    return "".join([*lines, "G1 X0 Y0\nG1 Z320\nM2\n"])


def write_artefact(path: Path) -> None:
    """artefact.json, with the true faces for the simulated probe."""
    path.write_text(json.dumps({"corners_mm": CORNERS_mm}))


def reading_times_s(samples: Sequence[MotionSample]) -> list[tuple[float, float]]:
    """Begin and end of each mark for reading the gauges."""
    times_s: list[tuple[float, float]] = []
    began_s: float | None = None
    for sample in samples:
        if sample.reading and began_s is None:
            began_s = sample.time_s
        elif not sample.reading and began_s is not None:
            times_s.append((began_s, sample.time_s))
            began_s = None
    return times_s


def write_probed_recording(path: Path, gauges: Sequence[Path], rounds: Sequence[Sequence[MotionSample]]) -> int:
    """Write the recording of the probing: one row for each corner and round, with the gauges at rest there.

    gauges : the parts that `compd recording start` has written meanwhile. rounds : the motion log of each run of the
    probing program. Returns the number of rows. Corners of a round that was not finished are left out, and so are those
    for which the gauges were not recorded, or at which the feed was held: the corrections stood.
    """
    recorded = [_recorded(part) for part in gauges]
    rows: list[dict[str, float]] = []
    for session, samples in enumerate(rounds, 1):
        for point, ((start_s, end_s), corner_mm) in enumerate(
            zip(reading_times_s(samples), CORNERS_mm, strict=False), 1
        ):
            found = [row for times_s, table in recorded for row in _between(times_s, table, start_s, end_s)]
            held = any(sample.inhibited for sample in samples if start_s <= sample.time_s <= end_s)
            if found and not held:
                reference = {
                    f"reference_{axis}_mm": place + CLEAR_mm for axis, place in zip("xyz", corner_mm, strict=True)
                }
                rows.append({**_mean(found), "session": session, "point": point, **reference})
    origin_s = rows[0]["time_s"] if rows else 0.0
    columns = {name: [row.get(name, np.nan) for row in rows] for name in (rows[0] if rows else {})}
    columns["time_s"] = [row["time_s"] - origin_s for row in rows]
    of_gauges = _sidecar(gauges[0]) if gauges else {}
    sidecar = sidecar_contents(
        "hexapod",
        {"quantity": "tool_position", "frame": "machine", "sigma_um": SIGMA_um},
        folds=["session"],
        # machine zero is taken once, before the first part
        quantities_at_zero=of_gauges.get("quantities_at_zero"),
        machine_file=gauges[0].parent / of_gauges["machine_file"] if "machine_file" in of_gauges else None,
    )
    write_recording(path, columns, sidecar, overwrite=True)
    return len(rows)


def _recorded(part: Path) -> tuple[FloatArray, list[dict[str, str]]]:
    """Times (CLOCK_MONOTONIC, s) and cells of a part that `compd recording start` has written."""
    with part.open(newline="") as file:
        rows = list(csv.DictReader(file))
    times_s = np.array([float(row["time_s"]) for row in rows])
    return times_s - times_s[:1] + _sidecar(part)["provenance"]["started_at_monotonic_s"], rows


def _sidecar(part: Path) -> Mapping[str, Any]:
    contents: Mapping[str, Any] = yaml.safe_load(part.with_suffix(".yaml").read_text())
    return contents


def _between(
    times_s: FloatArray, rows: Sequence[Mapping[str, str]], start_s: float, end_s: float
) -> list[dict[str, float]]:
    """Rows of that time in which no cell is empty, with the time as it is in `times_s`."""
    return [
        {name: float(cell) for name, cell in row.items()} | {"time_s": time_s}
        for time_s, row in zip(times_s.tolist(), rows, strict=True)
        if start_s <= time_s <= end_s and all(row.values())
    ]


def _mean(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The mean of each column; the directions of the links' last motion are those of the last row."""
    return {
        name: rows[-1][name] if name.startswith("approach_") else float(np.mean([row[name] for row in rows]))
        for name in rows[0]
    }
