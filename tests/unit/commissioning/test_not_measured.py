"""What no gauge measures is listed once for each kind of gauge, and nothing else is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from compd.configuration import load_machine
from compd.not_measured import not_measured

SHIPPED = Path("config/tripod-cmm.yaml")
LISTED = {"scale": "the scales", "joint": "the joints", "frame": "the frame", "quantities": "temperatures"}


@pytest.mark.parametrize("removed", [(), *((kind,) for kind in LISTED), tuple(LISTED)])
def test_each_kind_of_gauge_that_is_not_wired_is_one_clause(removed: tuple[str, ...]) -> None:
    configuration = load_machine(SHIPPED)
    wiring = configuration.wiring.model_copy(
        update={kind: type(getattr(configuration.wiring, kind))() for kind in removed}
    )
    clauses = not_measured(replace(configuration, wiring=wiring))
    assert [clause.startswith(LISTED[kind]) for kind, clause in zip(removed, clauses, strict=True)] == [True] * len(
        removed
    )


def test_a_stated_drift_of_the_frame_is_in_the_clause() -> None:
    configuration = load_machine(SHIPPED)
    wiring = configuration.wiring.model_copy(update={"frame": {}, "frame_drift_um": 5.0})
    (clause,) = not_measured(replace(configuration, wiring=wiring))
    assert "uncertain by 5 um along each axis" in clause
