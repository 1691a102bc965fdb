"""compare, diagnose and their pages on recordings of machines of one's own: one to three axes, lengths of links."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from plotly.graph_objects import Figure

from compd.comparison import compare, open_recording
from compd.model.library import load_library
from compd.report.figures import plot_residual_vectors, plot_workspace_map
from compd.report.small_multiples import NOT_RECORDED
from tests.support.command import run_in_process
from tests.support.external import Floats, measured_places, write_external
from tests.support.sampled import sampled

NOISE_MM = 1e-3


def with_temperature(columns: dict[str, Floats], name: str) -> dict[str, Floats]:
    """The columns, of which one follows the room's temperature by 4 um/K; rows in pairs of one visit."""
    rows = len(columns[name])
    room = 20 + np.cumsum(np.random.default_rng(7).normal(0, 0.2, rows // 2)).repeat(2)
    return {
        **columns,
        name: columns[name] + 0.004 * (room - 20),
        "temperature_room_degC": room,
        "visit": np.arange(rows) // 2 * 1.0,
    }


def lengths(links: list[int]) -> dict[str, Floats]:
    rng = np.random.default_rng(8)
    columns: dict[str, Floats] = {"approach_1": np.tile([1.0, -1.0], 120)}
    for link in links:
        columns[f"model_link_{link}_mm"] = np.round(rng.uniform(-50, 50, 240), 6)
        columns[f"reference_link_{link}_mm"] = columns[f"model_link_{link}_mm"] + rng.normal(0, NOISE_MM, 240)
    return with_temperature(columns, f"reference_link_{links[0]}_mm")


def positions(axes: str) -> dict[str, Floats]:
    return with_temperature(measured_places(axes, count=120), f"reference_{axes[0]}_mm")


LENGTH = {"quantity": "link_length", "sigma_um": 1.0}


@pytest.mark.parametrize(
    ("columns", "reference"),
    sampled(
        [
            *(pytest.param(positions(axes), None, id=axes) for axes in ("x", "z", "xy", "yz", "xyz")),
            *(
                pytest.param(lengths(links), LENGTH, id=f"links {links}")
                for links in ([1], [2], [1, 2, 3], [1, 2, 3, 4, 5, 6])
            ),
        ],
        9,
    ),
)
def test_what_an_external_recording_follows_is_described(
    tmp_path: Path, columns: dict[str, Floats], reference: dict[str, object] | None
) -> None:
    path = write_external(tmp_path, columns, reference)
    compared = json.loads(run_in_process("compare", str(path), "--json", "--html", str(tmp_path / "compare.html")))
    assert not compared["at_floor"]
    diagnosed = json.loads(run_in_process("diagnose", str(path), "--json", "--html", str(tmp_path / "diagnose.html")))
    assert diagnosed["steps"] == []
    assert diagnosed["depends_on"][0]["covariate"] == "temperature_room_degC"
    text = run_in_process("diagnose", str(path))
    assert "temperature_room_degC" in text
    for page in ("compare", "diagnose"):
        assert "</html>" in (tmp_path / f"{page}.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(("axes", "views"), [("x", 0), ("xy", 1), ("yz", 1), ("xyz", 3)])
def test_the_map_has_a_view_of_every_two_axes_that_are_known(tmp_path: Path, axes: str, views: int) -> None:
    comparison = compare(open_recording(write_external(tmp_path, positions(axes))))
    workspace, (vectors, _) = plot_workspace_map(comparison), plot_residual_vectors(comparison)
    assert (workspace is NOT_RECORDED) == (vectors is NOT_RECORDED) == (views == 0)
    if isinstance(workspace, Figure):
        assert len(workspace.data) == views


def test_a_link_that_is_measured_alone_has_its_own_scale(tmp_path: Path) -> None:
    columns = lengths([2])
    columns["scale_2_mm"] = columns["model_link_2_mm"]
    aligned = open_recording(write_external(tmp_path, columns, LENGTH))
    gain = aligned.columns(load_library()["scale_gain"], {})
    assert np.abs(gain).max() > 0
