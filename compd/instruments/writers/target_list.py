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
    """name; x_mm, y_mm, z_mm where the targets have a place; what is to be set or held; purpose."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    settings = list(dict.fromkeys(name for target in targets for name in target.settings))
    with_place = targets[0].tip_M_mm is not None
    writer.writerow(["name", *(["x_mm", "y_mm", "z_mm"] if with_place else []), *settings, "purpose"])
    for target in targets:
        place = [] if target.tip_M_mm is None else [f"{value:.3f}" for value in target.tip_M_mm]
        held = [f"{target.settings[name]:.10g}" if name in target.settings else "" for name in settings]
        writer.writerow([target.name, *place, *held, target.purpose])
    return stream.getvalue().encode()
