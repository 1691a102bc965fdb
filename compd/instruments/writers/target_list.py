"""Targets for the instrument: SpatialAnalyzer points that can be imported, and a list with commas."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

import numpy as np

from compd.instruments.formats.spatial_analyzer.writer import write_spatial_analyzer
from compd.instruments.samples import POSITION, Samples
from compd.instruments.writers.target import TargetPoint

# By these a file is known as a list of compd, which may be written over.
SA_MARK, CSV_MARK = "targets of compd plan", ",purpose\n"


def write_sa_targets(targets: Sequence[TargetPoint]) -> bytes:
    """Points of the collection `compd`, group `plan`, in {M} and mm. Every target needs a place."""
    samples = Samples(
        POSITION,
        np.array([target.tip_M_mm for target in targets]),
        names=[target.name for target in targets],
        group="plan",
    )
    return write_spatial_analyzer(samples, frame="compd::M", collection="compd", version=SA_MARK)


def write_csv_targets(targets: Sequence[TargetPoint]) -> bytes:
    """name; x_mm, y_mm, z_mm of a place and turn_x_rad ... of a turn, where there are any; what to set; purpose."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    settings = list(dict.fromkeys(name for target in targets for name in target.settings))
    with_place = targets[0].tip_M_mm is not None
    turns = ["turn_x_rad", "turn_y_rad", "turn_z_rad"] if targets[0].turn_rad is not None else []
    writer.writerow(["name", *(["x_mm", "y_mm", "z_mm"] if with_place else []), *turns, *settings, "purpose"])
    for target in targets:
        place = [] if target.tip_M_mm is None else [f"{value:.3f}" for value in target.tip_M_mm]
        held = [f"{target.settings[name]:.10g}" if name in target.settings else "" for name in settings]
        turn = [] if target.turn_rad is None else [f"{value:.6f}" for value in target.turn_rad]
        writer.writerow([target.name, *place, *turn, *held, target.purpose])
    return stream.getvalue().encode()
