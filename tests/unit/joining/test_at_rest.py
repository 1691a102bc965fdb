"""Points at rest beside the gauges: the joined recording has each point in the dwell in which it was measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison import compare, open_recording
from compd.configuration import load_machine
from compd.errors import RecordingError
from compd.instruments import InstrumentExport
from compd.joining.at_rest import By, RestJoin, match_at_rest
from compd.joining.by_time import Instrument
from compd.recording import read_recording, write_recording
from compd.simulation import Mechanism
from tests.support.planned_measurements import plan_file
from tests.support.points_at_rest import in_own_frame, points, write_gauges
from tests.support.simulated import tripod

MACHINE = load_machine("tripod-cmm")
TRUTH = Mechanism(tripod())
NOISE_MM = 0.0005
DWELL_S, MOVE_S = 3.0, 1.0


class Measured(NamedTuple):
    """gauges : the recording's file. tip_mm : (D, 3) in {M}. length_mm : (D, 3) changes of the links."""

    gauges: Path
    tip_mm: FloatArray
    length_mm: FloatArray

    def join(
        self, export: InstrumentExport, by: By = "order", link: int | None = None, plan: Path | None = None
    ) -> RestJoin:
        recording = read_recording(self.gauges, needs_reference=False)
        joined = match_at_rest(recording, MACHINE, export, Instrument(sigma_um=0.5, link=link), by, plan)
        write_recording(self.gauges.with_name("joined.csv"), joined.columns, joined.sidecar)
        return joined


def targets(rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    """(count, 3) places of the tip in {M} and the scales there, on a machine as drawn."""
    tip_mm = np.array([0, 0, 190.0]) + rng.uniform(-40, 40, (count, 3))
    lengths = np.array([TRUTH.lengths(TRUTH.posture_at(tip, np.zeros(3))) for tip in tip_mm])
    return tip_mm, lengths - TRUTH.lengths0_mm


def recorded_at_5_hz(directory: Path, rng: np.random.Generator, count: int = 20, repeats: bool = False) -> Measured:
    """A recording without ids: a dwell at machine zero, then `count` places, then machine zero again."""
    tip_mm, scale_mm = targets(rng, count)
    if repeats:
        tip_mm, scale_mm = np.tile(tip_mm, (2, 1))[:-3], np.tile(scale_mm, (2, 1))[:-3]
    tip_mm = np.vstack([[0, 0, 190], tip_mm, [0, 0, 190]])
    scale_mm = np.vstack([np.zeros(3), scale_mm, np.zeros(3)])
    arrive_s = np.arange(len(tip_mm)) * (DWELL_S + MOVE_S)
    time_s = np.arange(0, arrive_s[-1] + DWELL_S, 0.2)
    corners_s = np.column_stack([arrive_s, arrive_s + DWELL_S]).ravel()
    path = [np.interp(time_s, corners_s, np.repeat(scale, 2)) for scale in scale_mm.T]
    write_gauges(
        directory / "gauges.csv",
        time_s,
        np.column_stack(path) + rng.normal(0, 1e-5, (len(time_s), 3)),
        temperature_room_degC=20 + time_s / 100,
    )
    return Measured(directory / "gauges.csv", tip_mm, scale_mm)


def one_row_per_place(directory: Path, rng: np.random.Generator, count: int = 20) -> Measured:
    """A table as a person writes it: one row at each place, with the place's number."""
    tip_mm, scale_mm = targets(rng, count)
    write_gauges(directory / "gauges.csv", 60.0 * np.arange(count), scale_mm, point=1.0 + np.arange(count))
    return Measured(directory / "gauges.csv", tip_mm, scale_mm)


def seen(rng: np.random.Generator, tip_mm: FloatArray) -> FloatArray:
    return in_own_frame(tip_mm) + rng.normal(0, NOISE_MM, tip_mm.shape)


def test_by_order_from_dwells_that_nobody_numbered(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    measured = recorded_at_5_hz(tmp_path, rng)
    joined = measured.join(points(seen(rng, measured.tip_mm[1:21])))
    assert (joined.joined, joined.points, len(joined.dwells)) == (20, 20, 22)
    assert (joined.first[0], joined.first[1].number) == (2, 2)
    assert joined.left_out == {"dwells without a point": "1, 22"}
    assert joined.rms_mm < 5 * NOISE_MM
    assert joined.line.tolist() == list(range(2, 22))
    assert joined.dwell_number.tolist() == list(range(2, 22))
    assert 0 < joined.residual_mm.max() < 10 * NOISE_MM
    recording = read_recording(tmp_path / "joined.csv")
    middle_s = np.arange(1, 21) * (DWELL_S + MOVE_S) + DWELL_S / 2
    assert recording.time_s == pytest.approx(middle_s, abs=0.25)
    assert recording.scale_mm == pytest.approx(measured.length_mm[1:21], abs=2e-5)
    assert recording.quantities["temperature_room_degC"] == pytest.approx(20 + middle_s / 100, abs=0.01)
    assert recording.point is not None
    assert len(np.unique(recording.point)) == 20
    assert recording.approach_measured
    assert recording.reference is not None
    assert (recording.reference.quantity, recording.reference.frame) == ("tool_position", "instrument")
    provenance = recording.sidecar.provenance["join"]
    assert (provenance["by"], provenance["joined_points"], provenance["instrument"]) == ("order", 20, "points.csv")
    assert provenance["distances_rms_mm"] == pytest.approx(joined.rms_mm, abs=1e-6)
    assert provenance["next_best"]["distances_rms_mm"] > 1
    comparison = compare(open_recording(tmp_path / "joined.csv"))
    assert comparison.rms_um < 1.5e3 * NOISE_MM


def test_repeats_are_rows_of_one_visit_and_a_place_visited_later_is_the_same_point(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    measured = recorded_at_5_hz(tmp_path, rng, 12, repeats=True)
    each = np.repeat(np.arange(1, 22), 2)
    assert measured.join(points(seen(rng, measured.tip_mm[each]))).joined == 42
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.visit is not None
    assert recording.point is not None
    assert recording.visit.tolist() == np.repeat(np.arange(1, 22), 2).tolist()
    by_visit = recording.point[::2]
    assert by_visit[:9].tolist() == by_visit[12:].tolist()
    assert len(set(by_visit.tolist())) == 12
    assert (np.diff(recording.time_s) > 0).all()


def test_a_table_with_one_row_per_place_and_repeats_of_the_instrument(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    measured = one_row_per_place(tmp_path, rng)
    export = points(seen(rng, np.repeat(measured.tip_mm, 3, axis=0)))
    assert measured.join(export).joined == 60
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.point is not None
    assert recording.point.tolist() == np.repeat(np.arange(1, 21), 3).tolist()
    assert recording.scale_mm == pytest.approx(np.repeat(measured.length_mm, 3, axis=0))


@pytest.mark.parametrize("by", ["order", "distance", "name"])
def test_rows_without_times_are_joined_without_times(tmp_path: Path, by: By) -> None:
    rng = np.random.default_rng(5)
    tip_mm, scale_mm = targets(rng, 20)
    ids = 1.0 + np.arange(20)
    measured = Measured(write_gauges(tmp_path / "gauges.csv", None, scale_mm, point=ids), tip_mm, scale_mm)
    joined = measured.join(points(seen(rng, tip_mm), [f"{number:g}" for number in ids]), by)
    assert joined.joined == 20
    assert str(joined.last[1]) == "dwell 20 (point 20)"
    assert "time_s" not in (tmp_path / "joined.csv").read_text()
    recording = read_recording(tmp_path / "joined.csv")
    assert not recording.has_time
    assert recording.scale_mm == pytest.approx(scale_mm)


def test_rows_with_neither_times_nor_points_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    tip_mm, scale_mm = targets(rng, 20)
    measured = Measured(write_gauges(tmp_path / "gauges.csv", None, scale_mm), tip_mm, scale_mm)
    with pytest.raises(RecordingError, match="neither `time_s` nor `point`"):
        measured.join(points(seen(rng, tip_mm)))


def test_by_distance_in_any_order_and_without_names(tmp_path: Path) -> None:
    """The dwells at machine zero are at one place, at the start and at the end: its point has no clear dwell."""
    rng = np.random.default_rng(8)
    measured = recorded_at_5_hz(tmp_path, rng)
    order = rng.permutation(len(measured.tip_mm) - 1)
    joined = measured.join(points(seen(rng, measured.tip_mm[order])), "distance")
    zero_line = 2 + int(np.flatnonzero(order == 0)[0])
    assert joined.left_out["points that fit two dwells alike"] == f"line {zero_line}"
    assert joined.joined == 20
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.reference_mm == pytest.approx(in_own_frame(measured.tip_mm[1:-1]), abs=6 * NOISE_MM)
    assert recording.sidecar.provenance["join"]["by"] == "distance"
    with pytest.raises(RecordingError, match="by time or by order"):
        measured.join(points(measured.length_mm[:, :1]), "distance", link=1)


@pytest.mark.parametrize("named", ["P{:03d}", "{}", "pt {}"])
def test_by_name_in_any_order(tmp_path: Path, named: str) -> None:
    rng = np.random.default_rng(4)
    measured = one_row_per_place(tmp_path, rng)
    order = rng.permutation(20)
    names = [named.format(k + 1) for k in order]
    export = points(np.vstack([seen(rng, measured.tip_mm[order]), [[0, 0, 0]]]), [*names, "home"])
    joined = measured.join(export, "name")
    assert joined.left_out == {"names that no dwell has": "home"}
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.reference_mm is not None
    assert recording.reference_mm == pytest.approx(in_own_frame(measured.tip_mm), abs=6 * NOISE_MM)


def test_swapped_names_are_named_and_not_mended(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    measured = one_row_per_place(tmp_path, rng)
    names = [f"P{k}" for k in range(1, 21)]
    names[3], names[11] = names[11], names[3]
    with pytest.raises(RecordingError, match="P12 and P4 are swapped") as caught:
        measured.join(points(seen(rng, measured.tip_mm), names), "name")
    assert [problem.where for problem in caught.value.problems] == ["points.csv:5", "points.csv:13"]
    assert not (tmp_path / "joined.csv").exists()


def test_by_name_of_a_plans_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    measured = recorded_at_5_hz(tmp_path, rng)
    rows = [dict(zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), tip, strict=True)) for tip in measured.tip_mm[1:21]]
    plan = plan_file(tmp_path / "plan.csv", [{"time_s": 4.0 * k, **row} for k, row in enumerate(rows)])
    order = rng.permutation(20)[:15]
    export = points(seen(rng, measured.tip_mm[1:21][order]), [f"P{k + 1:03d}" for k in order])
    assert measured.join(export, "name", plan=plan).joined == 15
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.point is not None
    assert len(set(recording.point.tolist())) == 15
    assert recording.reference_mm == pytest.approx(in_own_frame(measured.tip_mm[1:21][np.sort(order)]), abs=0.005)
    other = plan_file(tmp_path / "other.csv", [{"tip_x_mm": 500.0, "tip_z_mm": 100.0}])
    with pytest.raises(RecordingError, match="dwelled at no place of the plan"):
        measured.join(export, "name", plan=other)


def test_a_plans_rows_at_one_place_share_its_dwell_and_are_visits_of_their_own(tmp_path: Path) -> None:
    """Two loads at one place: nothing moved between them that scales could show."""
    rng = np.random.default_rng(6)
    measured = recorded_at_5_hz(tmp_path, rng, 10)
    twice = np.repeat(np.arange(1, 11), 2)
    rows = [dict(zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), tip, strict=True)) for tip in measured.tip_mm[twice]]
    plan = plan_file(tmp_path / "plan.csv", [{"time_s": 2.0 * k, **row} for k, row in enumerate(rows)])
    names = [f"P{k:03d}" for k in range(1, 21)]
    assert measured.join(points(seen(rng, measured.tip_mm[twice]), names), "name", plan=plan).joined == 20
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.visit is not None
    assert recording.point is not None
    assert recording.visit.tolist() == list(range(1, 21))
    assert (recording.point[::2] == recording.point[1::2]).all()
    assert len(set(recording.point.tolist())) == 10


def test_times_say_which_visit_a_name_in_a_sorted_list_is_of(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    tip_mm, scale_mm = (np.tile(values, (2, 1)) for values in targets(rng, 8))
    ids = np.tile(1.0 + np.arange(8), 2)
    write_gauges(tmp_path / "gauges.csv", 60.0 * np.arange(16), scale_mm, point=ids)
    measured = Measured(tmp_path / "gauges.csv", tip_mm, scale_mm)
    by_name = np.argsort(ids, kind="stable")
    own_mm = seen(rng, tip_mm)
    export = points(own_mm[by_name], [f"P{k:.0f}" for k in ids[by_name]])
    with pytest.raises(RecordingError, match="order of measuring"):
        measured.join(export, "name")
    measured.join(replace(export, time_s=1000.0 + by_name), "name")
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.reference_mm == pytest.approx(own_mm)


def test_names_without_ids_of_dwells_are_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    measured = recorded_at_5_hz(tmp_path, rng)
    with pytest.raises(RecordingError, match="--plan"):
        measured.join(points(seen(rng, measured.tip_mm), [f"P{k}" for k in range(22)]), "name")
    with pytest.raises(RecordingError, match="has no names"):
        measured.join(points(seen(rng, measured.tip_mm)), "name")


def test_lengths_along_a_link(tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    measured = recorded_at_5_hz(tmp_path, rng)
    lengths = points(measured.length_mm[1:21, 1:2] + 7.0 + rng.normal(0, 1e-4, (20, 1)))
    with pytest.raises(RecordingError, match="--link"):
        measured.join(lengths)
    joined = measured.join(lengths, link=2)
    assert (joined.joined, joined.of_lengths) == (20, True)
    recording = read_recording(tmp_path / "joined.csv")
    assert recording.reference_links == (2,)
    assert recording.reference_link_mm is not None
    assert recording.reference_link_mm[:, 0] == pytest.approx(measured.length_mm[1:21, 1] + 7.0, abs=1e-3)
    with pytest.raises(RecordingError, match="by time or by order"):
        measured.join(lengths, "name", link=2)


def test_points_of_another_day_are_refused_beside_the_line(tmp_path: Path) -> None:
    rng = np.random.default_rng(9)
    measured = recorded_at_5_hz(tmp_path, rng)
    mixed_mm = measured.tip_mm[1:21].copy()
    mixed_mm[12:] = targets(rng, 8)[0]
    with pytest.raises(RecordingError, match="fit no dwell") as caught:
        measured.join(points(seen(rng, mixed_mm)))
    assert caught.value.problems[0].where.startswith("points.csv:14, beside dwell 14 at 53.")
    assert not (tmp_path / "joined.csv").exists()
