"""Targets as a programme and as lists: every line in the grammar of RS-274, every place and every hold in it."""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pytest

from compd.errors import CompdError
from compd.instruments.writers.gcode import FeedAndDwell
from compd.instruments.writers.target import Way
from compd.planning.plan_formats import plan_targets, target_bytes

# One line: a comment without parentheses in it, or words of a letter and a number without an exponent.
COMMENT = re.compile(r"\([ -'*-~]*\)")
WORDS = re.compile(r"[GMXYZFP]-?\d+(?:\.\d+)?(?: [GMXYZFP]-?\d+(?:\.\d+)?)*")
MOTION = FeedAndDwell(feed_mm_per_min=1200.0, dwell_s=2.5)


def row(number: int, x: float, time_s: float = 0.0, speed: float = 0.0, force: float = 0.0, side: int = 1) -> dict:
    return {
        "row": number,
        "purpose": 'load (in "steps"), \u00b5',
        "time_s": time_s,
        "tip_x_mm": x,
        "tip_y_mm": -0.0001,
        "tip_z_mm": 150.0,
        "force_z_N": force,
        "approach_1": side,
        "approach_2": side,
        "speed_mm_per_s": speed,
    }


def programme(rows: list[dict], ways: tuple[Way | None, ...] = ()) -> list[str]:
    return target_bytes(rows, "gcode", ways, MOTION, "a (title)").decode("ascii").splitlines()


def code(lines: list[str]) -> list[str]:
    return [line for line in lines if line and not line.startswith("(")]


def test_every_line_is_in_the_grammar() -> None:
    via = np.array([0.0, 0.0, 160.0])
    lines = programme(
        [row(k, 10.0 * k, force=-20.0 * k, speed=5.0 * (k == 3)) for k in range(1, 6)],
        (Way(via), None, Way(via, np.array([1e-9, 2.0, 140.0]), 7.25), Way(via), None),
    )
    for line in lines:
        assert line == "" or COMMENT.fullmatch(line) or WORDS.fullmatch(line), line
        assert len(line) < 256
    assert code(lines)[0] == "G21 G90 G94"
    assert lines[-1] == "M2"
    assert lines[0] == "(compd plan: a [title])"


def test_a_place_is_reached_from_its_side_and_rested_at() -> None:
    lines = programme([row(1, 12.3456)], (Way(np.array([12.0, 1.0, 160.25])),))
    assert code(lines)[-4:] == [
        "G1 X12.000 Y1.000 Z160.250 F1200.0",
        "G1 X12.346 Y0.000 Z150.000 F1200.0",
        "G4 P2.5",
        "M2",
    ]
    assert '(P001: load [in "steps"], u)' in lines


def test_a_place_is_passed_without_a_stop_at_the_tips_speed() -> None:
    way = Way(np.array([0.0, 0.0, 160.0]), np.array([0.0, 0.0, 140.0]), 7.25)
    lines = code(programme([row(1, 0.0, speed=5.0)], (way,)))
    assert lines[-3:-1] == ["G1 X0.000 Y0.000 Z160.000 F1200.0", "G1 X0.000 Y0.000 Z140.000 F435.0"]
    assert "G4 P2.5" not in lines


def test_it_stops_where_something_else_is_to_be_held() -> None:
    lines = programme([row(1, 0.0, force=20.0), row(2, 10.0, force=20.0), row(3, 10.0, force=-20.0)])
    said = [line for line in lines if line.startswith("(MSG")]
    assert said == ["(MSG, P001: set force_z_N 20, then go on)", "(MSG, P003: set force_z_N -20, then go on)"]
    assert lines.count("M0") == 2
    assert lines[lines.index(said[1]) + 1] == "M0"


def test_it_waits_for_the_times_of_a_programme() -> None:
    rows = [row(1, 0.0), row(2, 20.0, time_s=60.0), row(3, 40.0, time_s=60.0), row(4, 0.0, time_s=0.0)]
    lines = code(programme(rows, (None,) * 4))
    # 2.5 s at the first place and 1 s on the way of 20 mm at 1200 mm/min
    assert [line for line in lines if line.startswith("G4")] == ["G4 P2.5", "G4 P56.5", "G4 P2.5", "G4 P2.5", "G4 P2.5"]


def test_where_no_straight_way_comes_from_the_side_it_says_so() -> None:
    lines = programme([row(7, 0.0, side=-1)], (None,))
    assert "(by hand: no straight way of the tip moves the links as wanted: approach_1 -1, approach_2 -1)"[:60] in (
        "".join(lines)
    )
    assert not any("by hand" in line for line in programme([row(7, 0.0, side=0)], (None,)))


def test_targets_for_spatial_analyzer_can_be_found_by_name() -> None:
    lines = target_bytes([row(1, 12.5), row(12, -3.0)], "sa").decode().split("\r\n")
    assert lines[1] == "// Points Relative to Coordinate Frame 'compd::M'"
    assert lines[2] == "// AXES = CARTESIAN: X,  Y,  Z (mm)"
    assert [line.split(",  ") for line in lines[3:5]] == [
        ["compd", "plan", "P001", "12.500000", "-0.000100", "150.000000"],
        ["compd", "plan", "P012", "-3.000000", "-0.000100", "150.000000"],
    ]


def test_a_list_has_the_places_and_what_is_held() -> None:
    rows = list(csv.DictReader(io.StringIO(target_bytes([row(1, 12.5, force=20.0)], "csv").decode())))
    assert rows == [
        {
            "name": "P001",
            "x_mm": "12.500",
            "y_mm": "-0.000",
            "z_mm": "150.000",
            "force_z_N": "20",
            "purpose": 'load (in "steps"), \u00b5',
        }
    ]


def test_a_plan_without_places_is_a_list_and_nothing_else() -> None:
    rows = [{"row": 1, "purpose": "at these settings", "time_s": 0.0, "elevation_deg": 20}]
    assert target_bytes(rows, "csv").decode() == "name,elevation_deg,purpose\nP001,20,at these settings\n"
    for shape in ("sa", "gcode"):
        with pytest.raises(CompdError, match="whose kinematics is not known") as caught:
            target_bytes(rows, shape, motion=MOTION)
        assert caught.value.problems[0].value == "elevation_deg"


def test_columns_of_an_external_model_with_the_names_of_places_are_settings() -> None:
    rows = [{"row": 1, "purpose": "at these settings", "time_s": 0.0, "moved_1": -1, "approach_1": 1, "tip_x_mm": 7.5}]
    lines = target_bytes(rows, "csv").decode().splitlines()
    assert lines == ["name,moved_1,approach_1,tip_x_mm,purpose", "P001,-1,1,7.5,at these settings"]


def test_a_feed_is_asked_for() -> None:
    with pytest.raises(CompdError, match="needs a feed"):
        target_bytes([row(1, 0.0)], "gcode")


def test_programmes_begin_where_time_does_not_rise() -> None:
    rows = [row(1, 0.0), row(2, 0.0, time_s=30.0), row(3, 0.0), row(4, 0.0)]
    assert [target.begins for target in plan_targets(rows)] == [True, False, True, True]
