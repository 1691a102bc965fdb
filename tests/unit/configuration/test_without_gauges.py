"""A machine without any gauge is whole; a section that a gauge needs is missing where there is one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from compd.configuration import json_schema, load
from compd.errors import ConfigurationError
from compd.machine_check import load_whole
from compd.machine_kinds import KINDS
from tests.support.bare_machines import bare_machine
from tests.support.built_machines import drawing

WIRED = {"quantities": [{"name": "temperature_room_degC", "gauge": "room.t"}]}


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_of_any_kind_needs_no_gauge(tmp_path: Path, kind: str) -> None:
    configuration = load_whole(bare_machine(kind, tmp_path, wiring={"frame_drift_um": 30}))
    assert (dict(configuration.gauges), dict(configuration.lines), configuration.wiring.scale) == ({}, {}, ())
    assert configuration.wiring.frame_drift_um == 30
    assert configuration.warnings == ()


@pytest.mark.parametrize("wiring", [{}, None, {"scale": []}])
@pytest.mark.parametrize("lines", [{}, None])
@pytest.mark.parametrize("gauges", [{}, None])
def test_what_belongs_to_gauges_is_empty_or_left_out(tmp_path: Path, wiring: Any, lines: Any, gauges: Any) -> None:
    whole = load(bare_machine("6-rus", tmp_path, wiring=wiring, lines=lines, gauges=gauges))
    assert whole.config_hash == load(bare_machine("6-rus", tmp_path)).config_hash


@pytest.mark.parametrize("section", ["gauges", "lines", "wiring"])
def test_a_section_without_entries_is_no_empty_one(tmp_path: Path, section: str) -> None:
    path = bare_machine("3-spr", tmp_path, wiring=None)
    path.write_text(path.read_text() + f"{section}:\n")
    with pytest.raises(ConfigurationError, match=section):
        load(path)


def test_a_client_gives_the_pose_of_a_machine_without_gauges(tmp_path: Path) -> None:
    geometry = {"kinematics": "client"}
    assert load_whole(bare_machine("6-ups", tmp_path, machine="external", geometry=geometry)).gauges == {}


@pytest.mark.parametrize(
    ("missing", "what"),
    [
        ("gauges", "section `gauges` is missing or empty"),
        ("lines", "section `lines` is missing"),
        ("wiring", "section `wiring` is missing"),
    ],
)
def test_a_machine_with_scales_needs_all_of_it(tmp_path: Path, missing: str, what: str) -> None:
    path = drawing("6-ups", tmp_path)
    data = yaml.safe_load(path.read_text().replace("{on: platform", '{"on": platform'))
    del data[missing]
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(ConfigurationError, match=what):
        load(path)


def test_a_wired_quantity_needs_its_gauge(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="section `gauges` is missing or empty"):
        load(bare_machine("linear-delta", tmp_path, wiring=WIRED))


def test_the_schema_asks_for_lines_and_wires_where_there_are_gauges() -> None:
    schema = json_schema()
    assert not {"gauges", "lines", "wiring"} & set(schema["required"])
    assert {"machine", "geometry", "loop"} <= set(schema["required"])
    assert set(schema["dependentRequired"]["gauges"]) == {"lines", "wiring"}
