"""The defects of `defects.yaml`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import yaml

_HERE = Path(__file__).parent


class Defect(NamedTuple):
    """What a defect is, and which invariants find it.

    shows : which fault shows it. beside : kinds of such faults in rates.yaml. shown_by : the test of a scenario.
    """

    what: str
    invariants: Sequence[str]
    shows: str
    beside: Sequence[str]
    shown_by: str


DEFECTS: Mapping[str, Defect] = {
    name: Defect(**described)
    for name, described in yaml.safe_load((_HERE / "defects.yaml").read_text(encoding="utf-8")).items()
}
# Of each defect that is mended.
PATCHES: Mapping[str, Path] = {name: file for name in DEFECTS if (file := _HERE / f"{name}.patch").is_file()}
