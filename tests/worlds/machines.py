"""Machines of worlds: shipped configurations, machines of every kind that compd knows, and any file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from compd.configuration import Configuration
from compd.machine_kinds import KINDS, machine_text
from compd.simulation.truth.strengths import FULLY_MEASURED, Strengths, seen_by
from tests.support.paths import CONFIG

SHIPPED = ("tripod-cmm.yaml", "hexapod.yaml")
# Machines that a plan is drawn for by itself: as many shipped ones as others.
DRAWN = (*SHIPPED * 4, *KINDS)
# What `compd machine new` leaves to the owner of a machine: how far its frame moves, um.
FRAME_DRIFT_UM = 0.1
# Stated acceleration of a scale, of that of its drives.
STATED = 1.2
# Errors of a frame, which stands still where nothing measures it.
_OF_FRAMES = (
    "column_expansion_ppm_per_K",
    "ring_expansion_ppm_per_K",
    "column_give_along_um_per_N",
    "column_give_across_um_per_N",
)


def machine_file(name: str, directory: Path) -> Path:
    """The configuration of a machine, made in `directory` for a kind.

    name : a shipped file, a kind as "linear-delta", or a path.
    """
    if name in KINDS:
        path = directory / f"{name}.yaml"
        path.write_text(machine_text(name, name, KINDS[name].usual), encoding="utf-8")
        return path
    shipped = CONFIG / name
    return shipped if shipped.is_file() else Path(name)


def measured_errors(configuration: Configuration) -> Strengths:
    """Errors of a machine that its gauges measure: the bound of a setpoint holds no others."""
    errors = seen_by(FULLY_MEASURED, len(configuration.wiring.joint))
    return errors if configuration.wiring.frame else replace(errors, **dict.fromkeys(_OF_FRAMES, 0.0))


def fast(document: dict[str, Any], mm_per_s2: float) -> None:
    """Change a configuration: its scales state an acceleration that is above that of the drives, and a frame's drift.

    mm_per_s2 : of the drives.
    """
    for wire in document["wiring"]["scale"]:
        document["gauges"][wire["gauge"].partition(".")[0]]["acceleration_mm_per_s2"] = STATED * mm_per_s2
    if not document["wiring"].get("frame"):
        document["wiring"].setdefault("frame_drift_um", FRAME_DRIFT_UM)
