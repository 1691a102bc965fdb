"""A machine's own log in three shapes, and an instrument's points of the same poses."""

from __future__ import annotations

from datetime import datetime, timedelta
from itertools import islice
from pathlib import Path

import numpy as np
import openpyxl
from scipy.spatial.transform import Rotation

from tests.support.built_machines import built, drawing, poses, targets

LEGS = range(1, 7)
ROWS = 14
BOOK, GERMAN, TABBED, POINTS = "log.xlsx", "log.csv", "log.txt", "points.csv"


def write_log_files(directory: Path, exports: Path) -> Path:
    """The machine's file in `directory`; in `exports` a workbook of legs in m, a text with semicolons and decimal
    commas of poses with angles in degrees, a text with tabs below other lines of legs in mm, and the points."""
    exports.mkdir(parents=True, exist_ok=True)
    machine = drawing("6-ups", directory)
    rng = np.random.default_rng(6)
    world = built(machine, rng)
    wanted = list(islice(targets(world, rng), ROWS))
    rows = list(poses(world, wanted))
    assert len(rows) == ROWS
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["Nr", "Time", *(f"Leg {i} [m]" for i in LEGS)])
    german, tabbed = ["Zeit;X / mm;Y / mm;Z / mm;A;B;C"], ["Controller 7", "program poses.ngc, part 3", ""]
    tabbed.append("\t".join(["Nr", "comment", *(f"Leg {i} [mm]" for i in LEGS)]))
    begin = datetime(2026, 11, 28, 10, 2, 3)
    for k, ((place, turn), (reading_mm, _, _)) in enumerate(zip(wanted, rows, strict=True)):
        at = begin + timedelta(seconds=20 * k, milliseconds=500)
        sheet.append([k + 1, at, *(round(value / 1e3, 9) for value in reading_mm.tolist())])
        angles_deg = Rotation.from_rotvec(turn).as_euler("xyz", degrees=True)
        numbers = [f"{value:.6f}".replace(".", ",") for value in (*(world.drawn.tip0_M + place), *angles_deg)]
        german.append(";".join([at.strftime("%d.%m.%Y %H:%M:%S,5"), *numbers]))
        tabbed.append("\t".join([str(k + 1), "at rest", *(f"{value:.6f}" for value in reading_mm)]))
    book.save(exports / BOOK)
    (exports / GERMAN).write_text("\n".join(german) + "\n", encoding="utf-8")
    (exports / TABBED).write_text("\n".join(tabbed) + "\n", encoding="utf-8")
    points = ["name,x [mm],y [mm],z [mm]"]
    points += [f"p{k},{x:.6f},{y:.6f},{z:.6f}" for k, (x, y, z) in enumerate((row[1] for row in rows), start=1)]
    (exports / POINTS).write_text("\n".join(points) + "\n", encoding="utf-8")
    return machine
