"""Machines without any gauge: drawings whose controller is told poses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from tests.support.built_machines import drawing


def bare_machine(kind: str, directory: Path, **changed: Any) -> Path:
    """The configuration of a machine of this kind without `gauges` and `lines`.

    changed : sections to add, or to replace; None leaves one out.
    """
    data = yaml.safe_load(drawing(kind, directory).read_text().replace("{on: platform", '{"on": platform'))
    del data["gauges"], data["lines"]
    data = {**data, "wiring": {}, **changed}
    path = directory / f"bare-{kind}.yaml"
    path.write_text(yaml.safe_dump({name: part for name, part in data.items() if part is not None}, sort_keys=False))
    return path
