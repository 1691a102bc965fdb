"""Plausible ranges that belong to a machine: from its tolerance, or stated number by number."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from compd.errors import CompdError
from compd.model import machine_constants
from compd.model.effects import Effect, MachineDetails, Observations
from compd.model.library import load_library
from compd.parameter_ranges import check_ranges, on_machine, read_range
from tests.support.effect_rows import row_at_zero
from tests.support.model_machines import tripod

LIBRARY = load_library()


def rows(tolerance_mm: float, stroke_mm: float = np.nan) -> Observations:
    details = MachineDetails(tolerance_mm=tolerance_mm, link_limits_mm=(0.0, stroke_mm))
    return replace(row_at_zero(), constants=machine_constants(tripod(), details))


def range_of(effect: Effect) -> tuple[float, float]:
    return effect.parameters[0].low, effect.parameters[0].high


def test_without_a_tolerance_the_librarys_ranges_stay() -> None:
    for effect in LIBRARY.values():
        assert on_machine(effect, rows(np.nan)) is effect


@pytest.mark.parametrize("tolerance_mm", [0.005, 0.3, 5.0])
def test_geometric_effects_are_plausible_within_the_tolerance(tolerance_mm: float) -> None:
    machine = rows(tolerance_mm, stroke_mm=200.0)
    um = 1e3 * tolerance_mm
    for name in ("link_zero", "base_joint_position", "platform_joint_position", "tool_offset"):
        assert range_of(on_machine(LIBRARY[name], machine)) == pytest.approx((-um, um))
    ppm = 1e6 * tolerance_mm / 200.0
    assert range_of(on_machine(LIBRARY["scale_gain"], machine)) == pytest.approx((-ppm, ppm))
    joints = tripod().platform_joints_P_mm
    radius_mm = np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean())
    urad = 1e6 * tolerance_mm / radius_mm
    assert range_of(on_machine(LIBRARY["revolute_axis_tilt"], machine)) == pytest.approx((-urad, urad))
    # physical constants keep theirs
    assert on_machine(LIBRARY["link_expansion"], machine) is LIBRARY["link_expansion"]


def test_the_stroke_is_that_of_the_rows_where_none_is_stated() -> None:
    moved = rows(1.0)
    assert on_machine(LIBRARY["scale_gain"], moved) is LIBRARY["scale_gain"]  # one place has no stroke
    two = moved.extended_by(replace(moved, scale_mm=moved.scale_mm + np.array([[10.0, 50.0, 0.0]])))
    assert range_of(on_machine(LIBRARY["scale_gain"], two))[1] == pytest.approx(1e6 / 50.0)


def test_a_stated_range_goes_before_all() -> None:
    stated = [read_range("link_zero.z=-3..2mm")]
    check_ranges(stated, LIBRARY.values())
    assert range_of(on_machine(LIBRARY["link_zero"], rows(0.05), stated)) == (-3000.0, 2000.0)
    assert range_of(on_machine(LIBRARY["tool_offset"], rows(0.05), stated)) == pytest.approx((-50.0, 50.0))


@pytest.mark.parametrize(
    "text", ["link_zero.z", "link_zero.z=3..-3", "link_zero=1..2", "link_zero.z=a..b", "x.y=1.2.3..4"]
)
def test_what_states_no_range_is_refused(text: str) -> None:
    with pytest.raises(CompdError, match="no range of a number"):
        read_range(text)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("link_zero.q=1..2", "of no effect's parameter"),
        ("nothing.z=1..2", "of no effect's parameter"),
        ("link_zero.z=1..2ppm", "another unit"),
    ],
)
def test_a_range_of_nothing_or_in_another_unit_is_refused(text: str, said: str) -> None:
    with pytest.raises(CompdError, match=said):
        check_ranges([read_range(text)], LIBRARY.values())


def test_two_ranges_of_one_parameter_are_refused() -> None:
    with pytest.raises(CompdError, match=r"more than once\s+value: link_zero\.z"):
        check_ranges([read_range("link_zero.z=-1..1mm"), read_range("link_zero.z=-2..2mm")], LIBRARY.values())


def test_the_tolerance_changes_no_hash(tmp_path: Any) -> None:
    from compd.configuration import load, shipped_configuration

    text = shipped_configuration("hexapod.yaml").read_text()
    path = tmp_path / "hexapod.yaml"
    path.write_text(text.replace("  plate_thickness_mm: 200", "  plate_thickness_mm: 200\n  tolerance_mm: machined"))
    own, shipped = load(path), load(shipped_configuration("hexapod.yaml"))
    assert own.geometry.made_to_mm == 0.05
    assert own.geometry_hash == shipped.geometry_hash
    assert own.zero_hash == shipped.zero_hash
