"""The campaign that tests take apart: what an instrument saw, turned back, is the campaign's reference."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.instruments.export import ReadOptions
from compd.instruments.formats import written_forms
from compd.instruments.formats.carto.reader import read_carto
from compd.instruments.samples import POSITION
from compd.recording import read_recording
from compd.simulation import simulate_campaign
from tests.support.instrument_files import OFFSET_S, SplitCampaign, split_campaign, write_export
from tests.support.simulated import TRIPOD

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def split(tmp_path_factory: pytest.TempPathFactory) -> SplitCampaign:
    directory = tmp_path_factory.mktemp("campaign")
    simulate_campaign(TRIPOD, directory / "first.csv", seed=5, effects=["link_elasticity=60"])
    return split_campaign(directory / "first.csv", directory / "gauges.csv")


def test_the_gauges_alone_are_a_recording(split: SplitCampaign) -> None:
    recording = read_recording(split.gauges, needs_reference=False)
    assert recording.reference is None
    assert not {"point", "visit"} & set(recording.columns)
    assert recording.rows == len(split.time_s)


def test_the_track_passes_each_row_at_rest_and_has_a_clock_of_its_own(split: SplitCampaign) -> None:
    track = split.track()
    assert track.time_s is not None
    gap_s = np.diff(split.time_s, prepend=-np.inf, append=np.inf)
    rest = np.flatnonzero(split.at_rest() & (np.minimum(gap_s[:-1], gap_s[1:]) > 1.8))
    assert len(rest) > 450
    seen = np.column_stack(
        [np.interp(split.time_s[rest] - OFFSET_S, track.time_s, column) for column in track.values.T]
    )
    back = split.rotation.inv().apply(seen - split.shift_mm)
    np.testing.assert_allclose(back, split.values[rest], atol=5e-4)
    # at rest before and after the row as well
    early = np.column_stack(
        [np.interp(split.time_s[rest] - OFFSET_S - 0.25, track.time_s, column) for column in track.values.T]
    )
    np.testing.assert_allclose(early, seen, atol=5e-4)


def test_points_are_the_rows_at_rest_in_their_order(split: SplitCampaign) -> None:
    points = split.points()
    assert points.names is not None
    assert points.names[:2] == ["P1", "P2"]
    assert len(points.values) == split.at_rest().sum()
    named = split.points("place").names
    assert named is not None
    assert len(set(named)) < len(named) / 2


def test_every_shape_is_written(split: SplitCampaign, tmp_path: Path) -> None:
    for shape, form in written_forms().items():
        if POSITION in form.axes:
            assert write_export(tmp_path, shape, split.track(sessions=[1])).stat().st_size > 10_000


def test_an_interferometer_in_carto(tmp_path: Path) -> None:
    simulate_campaign(TRIPOD, tmp_path / "links.csv", seed=5, reference="interferometer")
    split = split_campaign(tmp_path / "links.csv", tmp_path / "gauges.csv", link=2)
    path = write_export(tmp_path, "carto", split.track(sessions=[1]), unit="um")
    export = read_carto(path, ReadOptions(unit="um"))
    assert export.time_s is not None
    first = split.at_rest() & (split.session == 1)
    time_s = split.time_s[first] - split.time_s[first][0]
    begin_s = time_s[0] + 1.5  # the track begins when the machine comes to rest at the first row
    seen = np.interp(time_s[1:] + begin_s, export.time_s, export.values[:, 0])
    np.testing.assert_allclose(seen, split.values[first, 0][1:], atol=0.05)
