"""The defects of `defects.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import yaml

_HERE = Path(__file__).parent


class Defect(NamedTuple):
    """What a defect is, which invariant finds it, which kind of fault shows it, and the test of a scenario."""

    what: str
    invariant: str
    kind: str
    shown_by: str


DEFECTS: Mapping[str, Defect] = {
    name: Defect(**described)
    for name, described in yaml.safe_load((_HERE / "defects.yaml").read_text(encoding="utf-8")).items()
}
# Of each defect that is mended.
PATCHES: Mapping[str, Path] = {name: file for name in DEFECTS if (file := _HERE / f"{name}.patch").is_file()}
