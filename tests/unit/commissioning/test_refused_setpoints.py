"""`compd check` ends with a line where no setpoint can be valid, and says no such thing where one can."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from compd.cli.app import app
from compd.commissioning import certain_refusal
from compd.configuration import Configuration, load
from compd.documents import read_document
from compd.live.loop import Target
from compd.setpoint_states import State
from tests.support.bare_machines import bare_machine
from tests.support.built_machines import drawing
from tests.support.external_machines import class_geometry, external_yaml
from tests.support.live_machine import Machine
from tests.support.live_models import file_with
from tests.support.paths import CONFIG

FRAME = "the frame is not measured whole; state how far that moves the tip, `wiring: frame_drift_um`"


def changed(path: Path, tmp_path: Path, **sections: dict[str, Any]) -> Path:
    """The configuration with these keys of its sections changed; a key of None is taken out."""
    data = read_document(path).data
    for section, keys in sections.items():
        data[section] = {key: value for key, value in {**data[section], **keys}.items() if value is not None}
    file = tmp_path / "changed.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    return file


def scales_only(kind: str, tmp_path: Path, drift_um: float | None, **limits: float) -> Path:
    return changed(drawing(kind, tmp_path), tmp_path, wiring={"frame_drift_um": drift_um}, limits=limits)


def is_refused(configuration: Configuration) -> bool:
    """Whether the daemon's cycles refuse every setpoint of a machine at rest at its zero, in each mode."""
    states = []
    for target in (None, Target(tuple(Machine(configuration).model.zero.contact.tip_M_mm.tolist()))):
        live = Machine(configuration)
        live.commands.target = target
        states += [live.step().state for _ in range(20)]
    return set(states) == {State.REFUSED}


@pytest.mark.parametrize("kind", ["6-ups", "3-prs", "linear-delta"])
def test_scales_alone_with_a_limit_of_the_error_need_the_drift_of_the_frame(kind: str, tmp_path: Path) -> None:
    configuration = load(scales_only(kind, tmp_path, None, tip_error_um=100))
    assert certain_refusal(configuration).startswith("Every setpoint will be refused: the bound of the tip's error")
    assert certain_refusal(configuration).endswith(f"{FRAME}.")
    assert is_refused(configuration)


@pytest.mark.parametrize("limits", [{}, {"tip_error_um": 60}])
@pytest.mark.parametrize("kind", ["3-spr", "rotary-delta"])
def test_nothing_is_said_where_a_setpoint_can_be_valid(kind: str, limits: dict[str, float], tmp_path: Path) -> None:
    configuration = load(scales_only(kind, tmp_path, 20, **limits))
    assert certain_refusal(configuration) == ""
    assert not is_refused(configuration)


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_nothing_is_said_of_a_shipped_machine(name: str) -> None:
    assert certain_refusal(load(CONFIG / name)) == ""


@pytest.mark.parametrize("bare", [True, False])
def test_a_frame_that_drifts_by_more_than_the_limit_refuses_everywhere(bare: bool, tmp_path: Path) -> None:
    limits = {"correction_mm": 0.5, "slew_mm_per_s": 0.5, "on_limit": "clamp", "tip_error_um": 100}
    drift = {"frame_drift_um": 40}
    if bare:
        path = bare_machine("6-rus", tmp_path, wiring=drift, limits=limits)
    else:
        path = scales_only("6-rus", tmp_path, 40, tip_error_um=100)
    assert certain_refusal(load(path)).startswith("Every setpoint will be refused: the tip may be 112 um from here")


def test_gauges_that_scatter_by_more_than_the_limit_refuse_at_machine_zero(tmp_path: Path) -> None:
    said = certain_refusal(load(scales_only("6-ups", tmp_path, 0.0, tip_error_um=0.01)))
    assert said.startswith("At machine zero every setpoint will be refused: the tip may be ")
    assert "the scatter of the gauges" in said


@pytest.mark.parametrize(
    ("name", "gauge", "skew_s", "refused"),
    [
        ("tripod-cmm.yaml", "frame_u", 0.001, True),
        ("tripod-cmm.yaml", "frame_u", 0.1, False),
        ("hexapod.yaml", "frame", 0.001, False),
    ],
)
def test_comparators_that_cannot_be_read_within_the_skew_refuse_everywhere(
    name: str, gauge: str, skew_s: float, refused: bool, tmp_path: Path
) -> None:
    """On the line of the tripod's cabinet is another comparator; on that of the hexapod's are thermometers."""
    moved = read_document(CONFIG / name).data["gauges"][gauge] | {"line": "cabinet"}
    said = certain_refusal(load(changed(CONFIG / name, tmp_path, loop={"skew_s": skew_s}, gauges={gauge: moved})))
    assert said.startswith("Every setpoint will be refused: the comparators on line `cabinet` are read") == refused
    assert bool(said) == refused


@pytest.mark.parametrize("kind", ["6-pus", "rotary-delta"])
def test_a_gauge_that_states_no_noise_refuses_everywhere(kind: str, tmp_path: Path) -> None:
    path = scales_only(kind, tmp_path, 20, tip_error_um=100)
    silent = {key: value for key, value in read_document(path).data["gauges"]["scales"].items() if key != "noise_um"}
    said = certain_refusal(load(changed(path, tmp_path, gauges={"scales": silent})))
    assert said.startswith("Every setpoint will be refused: ")
    assert "nobody states how much scales scatters" in said


def test_thermometers_of_the_model_that_state_no_noise_refuse_everywhere(tmp_path: Path) -> None:
    model = file_with(tmp_path / "m.yaml", "link_expansion", name="tripod-cmm", links=3)
    wires = read_document(CONFIG / "tripod-cmm.yaml").data["wiring"]["quantities"]
    quantities = [{key: value for key, value in wire.items() if key != "noise"} for wire in wires]
    sections = {"wiring": {"quantities": quantities}, "state": {"model_file": str(model)}}
    said = certain_refusal(load(changed(CONFIG / "tripod-cmm.yaml", tmp_path, **sections)))
    assert said.startswith("Every setpoint will be refused: ")
    assert "`noise` of it under `wiring: quantities:`" in said
    with_noise = load(changed(CONFIG / "tripod-cmm.yaml", tmp_path, state={"model_file": str(model)}))
    assert certain_refusal(with_noise) == ""


@pytest.mark.parametrize("drift_um", [None, 0.0])
@pytest.mark.parametrize("kind", ["class", "client"])
def test_a_machine_whose_pose_is_given(kind: str, drift_um: float | None, tmp_path: Path) -> None:
    geometry = class_geometry(tmp_path) if kind == "class" else {"kinematics": "client"}
    path = external_yaml(tmp_path, geometry)
    configuration = load(changed(path, tmp_path, wiring={"frame_drift_um": drift_um}, limits={"tip_error_um": 50}))
    assert bool(certain_refusal(configuration)) == (drift_um is None)


def test_the_line_is_the_last_one_of_compd_check(tmp_path: Path) -> None:
    last = {}
    for drift_um in (None, 20.0):
        path = scales_only("3-rps", tmp_path, drift_um, tip_error_um=200)
        result = CliRunner().invoke(app, ["check", str(path)])
        assert result.exit_code == 0
        last[drift_um] = result.output.splitlines()[-1]
    assert last[None].startswith("Every setpoint will be refused: ")
    assert last[None].endswith(f"{FRAME}.")
    assert "is complete" in last[20.0]
