"""Machines of worlds: shipped configurations, machines of every kind that compd knows, and any file."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from compd.configuration import Configuration
from compd.documents import read_document
from compd.machine_kinds import KINDS, machine_text
from compd.simulation.truth.strengths import FULLY_MEASURED, Strengths, seen_by
from tests.support.paths import CONFIG

SHIPPED = ("tripod-cmm.yaml", "hexapod.yaml")
# Suffix of a kind whose scales have a line each, and whose joints are measured.
MEASURED = "-measured"
# Machines that a plan is drawn for by itself: half of them shipped ones, a tenth with all scales on one line.
DRAWN = (*SHIPPED * 5, *(f"{kind}{MEASURED}" for kind in KINDS), "6-ups", "linear-delta")
# What `compd machine new` leaves to the owner of a machine: how far its frame moves, um.
FRAME_DRIFT_UM = 0.1
# Stated acceleration of a scale, of that of its drives.
STATED = 1.2
# Of a joint comparator: its range, mm, and acceleration, mm/s2.
_JOINT_MM, _JOINT_MM_PER_S2 = 1.0, 20
# Errors of a frame, which stands still where nothing measures it.
_OF_FRAMES = (
    "column_expansion_ppm_per_K",
    "ring_expansion_ppm_per_K",
    "column_give_along_um_per_N",
    "column_give_across_um_per_N",
)


def machine_file(name: str, directory: Path) -> Path:
    """The configuration of a machine, made in `directory` for a kind.

    name : a shipped file, a kind as "linear-delta" or "linear-delta-measured", or a path.
    """
    kind = name.removesuffix(MEASURED)
    if kind in KINDS:
        path = directory / f"{name}.yaml"
        path.write_text(machine_text(kind, kind, KINDS[kind].usual), encoding="utf-8")
        if name != kind:
            document = deepcopy(read_document(path).data)
            measure(document)
            path.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")
        return path
    shipped = CONFIG / name
    return shipped if shipped.is_file() else Path(name)


def measure(document: dict[str, Any]) -> None:
    """Give each scale of a machine that was just made a line of its own, and each link a joint comparator."""
    lines, gauges, wiring = document["lines"], document["gauges"], document["wiring"]
    ((_, line),), ((_, scales),) = lines.items(), gauges.items()
    lines.clear()
    gauges.clear()
    joints = []
    for number, (wire, channel) in enumerate(zip(wiring["scale"], scales["channels"], strict=True), start=1):
        name = wire["gauge"] = channel["name"]
        lines[name] = line | {"port": line["port"] + number}
        gauges[name] = scales | {"line": name, "channels": [channel]}
        joints.append(channel | {"name": f"joint_{number}", "lowest": -_JOINT_MM, "highest": _JOINT_MM})
    lines["joints"] = line
    gauges["joints"] = scales | {"line": "joints", "channels": joints, "acceleration_mm_per_s2": _JOINT_MM_PER_S2}
    wiring["joint"] = [{"link": k, "role": "S", "gauge": f"joints.joint_{k}"} for k in range(1, len(joints) + 1)]


def measured_errors(configuration: Configuration) -> Strengths:
    """Errors of a machine that its gauges measure: the bound of a setpoint holds no others."""
    joints, links = len(configuration.wiring.joint), len(configuration.wiring.scale)
    errors = seen_by(FULLY_MEASURED, joints if joints > links else 0)  # of both ends of a link
    return errors if configuration.wiring.frame else replace(errors, **dict.fromkeys(_OF_FRAMES, 0.0))


def fast(document: dict[str, Any], mm_per_s2: float) -> None:
    """Change a configuration: its scales state an acceleration that is above that of the drives, and a frame's drift.

    mm_per_s2 : of the drives.
    """
    for wire in document["wiring"]["scale"]:
        document["gauges"][wire["gauge"].partition(".")[0]]["acceleration_mm_per_s2"] = STATED * mm_per_s2
    if not document["wiring"].get("frame"):
        document["wiring"].setdefault("frame_drift_um", FRAME_DRIFT_UM)
