"""`compd machine new`, its drawing, and what `compd check` says of the machine: of every kind, from its dimensions."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from compd.cli.start.check import print_lines
from compd.errors import CompdError, ConfigurationError
from compd.machine_builder import build_model
from compd.machine_check import load_whole
from compd.machine_kinds import KINDS, Dimensions, machine_text
from compd.machine_reach import machine_reach, reach_lines
from compd.model import MachineModel
from compd.report import machine_svg

MAX_LINES = 60


def dimensions_of(kind: str, seed: int) -> Dimensions:
    """The usual dimensions, each changed by up to a fifth."""
    usual = np.array(KINDS[kind].usual)
    return Dimensions(*(usual * np.random.default_rng(seed).uniform(0.8, 1.2, len(usual))).tolist())


def made(tmp_path: Path, kind: str, dimensions: Dimensions) -> tuple[str, MachineModel]:
    text = machine_text("mine", kind, dimensions)
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    configuration = load_whole(path)
    return text, build_model(configuration.geometry, configuration.wiring)


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_machine_is_short_and_complete(tmp_path: Path, kind: str) -> None:
    for seed in range(3):
        dimensions = dimensions_of(kind, seed)
        text, model = made(tmp_path, kind, dimensions)
        assert len(text.splitlines()) <= MAX_LINES
        # it stands where its dimensions say, level
        assert model.zero.platform_origin_M_mm == pytest.approx([0.0, 0.0, dimensions.height_mm], abs=1e-4)
        assert model.zero.rotation_M_P == pytest.approx(np.eye(3), abs=1e-6)
        radii = np.hypot(*model.platform_joints_P_mm[:, :2].T)
        if KINDS[kind].legs != "pairs":
            assert radii == pytest.approx(np.full(model.links, dimensions.platform_radius_mm), abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_reach_and_drawing(tmp_path: Path, kind: str) -> None:
    _, model = made(tmp_path, kind, KINDS[kind].usual)
    reach = machine_reach(model)
    assert "".join(reach.fixes) == KINDS[kind].target_fixes
    assert all(way.reach > 0 for way in reach.ways)
    assert 1.0 < reach.amplification < 100.0
    assert len(reach_lines(reach)) == 3
    svg = ElementTree.fromstring(machine_svg(model, "mine <1>"))
    texts = [element.text for element in svg.iter("{http://www.w3.org/2000/svg}text")]
    assert {str(i + 1) for i in range(model.links)} <= set(texts)


def test_a_stroke_ends_a_way(tmp_path: Path) -> None:
    _, model = made(tmp_path, "6-ups", KINDS["6-ups"].usual)
    length_mm = float(model.zero.link_length_mm[0])
    reach = machine_reach(model, (length_mm - 50.0, length_mm + 50.0))
    up = next(way for way in reach.ways if (way.coordinate, way.sign) == ("z", 1))
    assert up.ends == "stroke"
    assert 40.0 < up.reach < 70.0


def test_rods_that_repeat_each_other_are_named(tmp_path: Path) -> None:
    data = yaml.safe_load(machine_text("mine", "6-ups", KINDS["6-ups"].usual).replace("on: platform", '"on": platform'))
    rods = data["geometry"]["rods"]
    # nearly the same joints: no two rods are equal by their numbers
    rods[3]["base_B_mm"] = [value + 1e-3 for value in rods[0]["base_B_mm"]]
    rods[3]["platform_P_mm"] = rods[0]["platform_P_mm"]
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False))
    with pytest.raises(ConfigurationError, match="rod 1, rod 4 repeat or contradict each other"):
        load_whole(path)


def test_impossible_dimensions_are_all_told() -> None:
    wrong = KINDS["rotary-delta"].usual._replace(base_radius_mm=-1.0, crank_mm=0.0, height_mm=float("nan"))
    with pytest.raises(CompdError) as caught:
        machine_text("mine", "rotary-delta", wrong)
    told = str(caught.value)
    assert all(option in told for option in ("--base-radius", "--crank", "--height"))


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_machine_polls_no_faster_than_its_loop_needs_and_is_checked_without_a_warning(
    tmp_path: Path, kind: str
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(machine_text("mine", kind, KINDS[kind].usual))
    configuration = load_whole(path)
    assert [line.poll_every_s for line in configuration.lines.values()] == [0.5 / configuration.loop.rate_hz]
    assert (*configuration.warnings, *print_lines(configuration)) == ()
