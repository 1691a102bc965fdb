"""Over all rows in blocks, a fit finds what it finds in memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.effect_fit import fit, initial_effect
from compd.comparison.neighbour_block import neighbour_blocks
from compd.comparison.stream.block_fit import RowClusters, fit_blocks
from compd.comparison.stream.sample import draw_sample
from compd.model.library import load_library
from compd.recording import Recording, read_recording
from tests.support.measured import gauges, hidden, record, tripod
from tests.support.sampled import sampled
from tests.support.streams import in_blocks

ROWS, BLOCK = 600, 70
LIBRARY = load_library()
SIGMA_UM = np.full(3, 0.15)
INSTRUMENT = {"quantity": "tool_position", "frame": "instrument", "sigma_um": 0.15}
MODELS: dict[str, list[tuple[str, dict[str, float]]]] = {
    "links": [("link_expansion", {}), ("backlash", {})],
    "constant": [("tool_offset", {}), ("link_elasticity", {})],
    "lag": [("link_expansion_lag", {"tau": 900.0})],
}


def recorded(directory: Path, reference: dict[str, Any] | None, drop: tuple[str, ...] = ()) -> Recording:
    columns = {name: values for name, values in gauges(ROWS, 3).items() if name not in drop}
    truth = [hidden("link_expansion_lag", 1.1, tau=900.0), hidden("backlash", 0.9, 1.1, 0.8)]
    path = record(directory, columns, truth, reference=reference)
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[40] = ",".join([*lines[40].split(",")[:-1], "999.0"])
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_recording(path, tripod())


@pytest.mark.parametrize("reference", [None, INSTRUMENT], ids=["own frame", "instrument's frame"])
@pytest.mark.parametrize("model", sampled(MODELS, 3))
def test_the_same_numbers_as_in_memory(tmp_path: Path, model: str, reference: dict[str, Any] | None) -> None:
    recording = recorded(tmp_path, reference)
    effects = [initial_effect(LIBRARY[name], constants, 3) for name, constants in MODELS[model]]
    whole = fit(align_recording(recording, tripod()), effects, SIGMA_UM)
    stream = in_blocks(recording, tripod(), BLOCK)
    sample = draw_sample(stream)
    streamed = fit_blocks(stream, sample, fit(sample.aligned, effects, SIGMA_UM), SIGMA_UM)
    assert streamed.clusters == whole.clusters
    std = np.sqrt(np.diag(whole.covariance))
    for one, other in zip(streamed.fitted, whole.fitted, strict=True):
        np.testing.assert_allclose(one.theta, other.theta, rtol=1e-9, atol=1e-6 * np.nanmin(std))
    np.testing.assert_allclose(streamed.covariance, whole.covariance, rtol=1e-5)


def test_from_a_small_sample_the_fit_of_all_rows_is_found(tmp_path: Path) -> None:
    recording = recorded(tmp_path, None)
    effects = [initial_effect(LIBRARY[name], constants, 3) for name, constants in MODELS["links"]]
    whole = fit(align_recording(recording, tripod()), effects, SIGMA_UM)
    stream = in_blocks(recording, tripod(), BLOCK)
    sample = draw_sample(stream, 150)
    start = fit(sample.aligned, effects, SIGMA_UM)
    streamed = fit_blocks(stream, sample, start, SIGMA_UM)
    std = np.sqrt(np.diag(whole.covariance))
    theta, other, before = (
        np.concatenate([effect.theta for effect in each.fitted]) for each in (whole, streamed, start)
    )
    assert np.abs(other - theta).max() < 0.2 * np.abs(before - theta).max()
    assert (np.abs(other - theta) < 0.2 * std).all()
    assert list(streamed.ranges) == [f"temperature_link_{i}_degC" for i in (1, 2, 3)]
    assert streamed.ranges == whole.ranges, "an effect is fitted to all rows, not to those of the sample alone"
    assert any(streamed.ranges[name] != start.ranges[name] for name in start.ranges)


@pytest.mark.parametrize("drop", [(), ("visit",), ("session", "visit")], ids=["both", "no visits", "neither"])
def test_clusters_are_those_of_the_whole_recording(tmp_path: Path, drop: tuple[str, ...]) -> None:
    recording = recorded(tmp_path, None, drop)
    stream = in_blocks(recording, tripod(), BLOCK)
    clusters = RowClusters(draw_sample(stream))
    numbers = np.concatenate([clusters.number(part) for part in stream.read()])
    np.testing.assert_array_equal(numbers, neighbour_blocks(recording))


def test_a_session_with_many_clusters_of_its_own(tmp_path: Path) -> None:
    recording = recorded(tmp_path, None)
    many = replace(recording, session=np.arange(ROWS) // 20)
    stream = in_blocks(many, tripod(), BLOCK)
    clusters = RowClusters(draw_sample(stream))
    numbers = np.concatenate([clusters.number(part) for part in stream.read()])
    np.testing.assert_array_equal(numbers, neighbour_blocks(many))
