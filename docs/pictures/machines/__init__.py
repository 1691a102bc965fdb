"""Pictures of the kinds of machine, as `compd machine draw` makes them of `compd machine new`.

Made by `python -m docs.pictures.machines`; a test compares.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from compd.configuration import load
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.report import machine_svg

HERE = Path(__file__).parent


def pictures() -> dict[str, str]:
    """File name and text of each picture."""
    made = {}
    with tempfile.TemporaryDirectory() as directory:
        for kind, description in KINDS.items():
            path = Path(directory) / "machine.yaml"
            path.write_text(machine_text(kind, kind, description.usual), encoding="utf-8")
            configuration = load(path)
            model = build_model(configuration.geometry, configuration.wiring)
            made[f"{kind}.svg"] = machine_svg(model, kind)
    return made
