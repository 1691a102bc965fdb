"""The configuration of a case's machine: as shipped, one of the kinds, or without its period."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from compd.configuration import Configuration, load, shipped_configuration
from compd.machine_kinds import KINDS, Dimensions, machine_text
from tests.scoreboard.case import KINDS_FAMILY, Case

# Period that nobody has configured, mm: a screw's pitch, a gear's turn.
PERIOD_MM = (0.7, 6.0)
# Dimensions of a machine of a kind, over the usual ones.
DIMENSION_SHARES = (0.9, 1.1)


def configuration_of(case: Case, directory: Path) -> Configuration:
    """The configuration, as the diagnosis sees it; the case's own is written into the directory as machine.yaml."""
    if case.family == KINDS_FAMILY:
        path = directory / "machine.yaml"
        path.write_text(machine_text(case.kind, case.kind, _dimensions(case)), encoding="utf-8")
        return load(path)
    if case.family != "period":
        return load(shipped_configuration("hexapod.yaml" if case.family == "hexapod" else "tripod-cmm.yaml"))
    text = shipped_configuration("tripod-cmm.yaml").read_text(encoding="utf-8")
    path = directory / "machine.yaml"
    path.write_text(re.sub(r"(?m)^ *scale_signal_period_mm:.*\n", "", text), encoding="utf-8")
    return load(path)


def period_mm(case: Case) -> float:
    """The period that only the simulated machine knows."""
    low, high = np.log(PERIOD_MM)
    return round(float(np.exp(case.rng("period").uniform(low, high))), 3)


def _dimensions(case: Case) -> Dimensions:
    """Of a machine like the usual one of its kind, and of no other size by much."""
    usual = KINDS[case.kind].usual
    shares = case.rng("dimensions").uniform(*DIMENSION_SHARES, len(usual)).tolist()
    return Dimensions(*(round(value * share, 1) for value, share in zip(usual, shares, strict=True)))
