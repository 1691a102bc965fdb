"""A step of a model file: from where its effects count afterwards, and in which range they were fitted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import compd
from compd.comparison import AlignedRecording
from compd.errors import CompdError
from compd.machine_kinds import KINDS, machine_text
from compd.model.library import load_library
from compd.model_changes import add_to_model, remove_effect
from compd.model_file import ModelFile
from tests.support.measured import aligned, gauges, hidden, record

ROWS = 90
LINKS = [f"temperature_link_{i}_degC" for i in (1, 2, 3)]
LIBRARY = load_library()


def recorded(
    directory: Path, name: str, sidecar: dict[str, Any], no_reference: int | None = None, **columns: np.ndarray
) -> AlignedRecording:
    """A recording of links that grow. sidecar : more keys of it.  no_reference : a row (from 0) without one."""
    path = record(directory, gauges(ROWS, 31) | columns, [hidden("link_expansion", 1.1)], name=name)
    content = yaml.safe_load(path.with_suffix(".yaml").read_text(encoding="utf-8"))
    path.with_suffix(".yaml").write_text(yaml.safe_dump(content | sidecar), encoding="utf-8")
    if no_reference is not None:
        lines = path.read_text(encoding="utf-8").splitlines()
        cells = lines[no_reference + 1].split(",")
        cells[lines[0].split(",").index("reference_x_mm")] = ""
        lines[no_reference + 1] = ",".join(cells)
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return aligned(path)


def datums(model: ModelFile) -> dict[str, str]:
    return {fitted.effect.id: fitted.effect.counts_from for fitted in model.fitted}


def test_what_is_fitted_without_the_quantities_at_zero_says_so(tmp_path: Path) -> None:
    """All effects are fitted anew in a step, those that the model had already, too."""
    known = recorded(tmp_path, "new", {"quantities_at_zero": dict.fromkeys(LINKS, 19.0)})
    unknown = recorded(tmp_path, "old", {})
    model = compd.add_effect(compd.add_effect(None, "link_expansion", known), "tool_offset", known)
    assert datums(model)["link_expansion"] == "machine zero"
    for changed in (
        add_to_model(model, "link_zero", LIBRARY["link_zero"], unknown),
        remove_effect(model, "tool_offset", unknown),
    ):
        assert datums(changed)["link_expansion"] == "20 degC"
        changed.write(tmp_path / "m.yaml")
        entry = yaml.safe_load((tmp_path / "m.yaml").read_text(encoding="utf-8"))["effects"][0]
        assert (entry["effect"], entry["counts_from"]) == ("link_expansion", "20 degC")
    for changed in (
        add_to_model(model, "link_zero", LIBRARY["link_zero"], known),
        remove_effect(model, "tool_offset", known),
    ):
        assert datums(changed)["link_expansion"] == "machine zero"


def test_the_range_is_that_of_the_rows_that_were_fitted(tmp_path: Path) -> None:
    """Not of a row that a person has excluded, nor of one without a reference."""
    temperature = gauges(ROWS, 31)[LINKS[0]].copy()
    temperature[[10, 40]] = 49.0, -3.0
    recording = recorded(
        tmp_path, "run", {"excluded_rows": [{"row": 12, "reason": "warm"}]}, 40, temperature_link_1_degC=temperature
    )
    model = compd.add_effect(None, "link_expansion", recording)
    used = np.delete(np.arange(ROWS), [10, 40])
    low, high = model.fitted_range[LINKS[0]]
    assert (low, high) == pytest.approx((temperature[used].min(), temperature[used].max()), abs=1e-9)
    assert list(model.fitted_range) == LINKS


def test_a_stated_range_goes_into_the_model_file(tmp_path: Path) -> None:
    """What a person stated for one machine holds where the model is adopted, too."""
    recording, machine = tmp_path / "zeros.csv", tmp_path / "hexa.yaml"
    machine.write_text(machine_text("hexa", "6-ups", KINDS["6-ups"].usual).replace("machined", "ground"))
    compd.simulate_campaign(machine, recording, seed=3, effects=["link_zero=200"])
    aligned = compd.open_recording(recording, machine, ranges=["link_zero.z=-0.5..0.5mm"])
    model = compd.add_effect(None, "link_zero", aligned)
    assert model.plausible == {"link_zero": {f"z_{i}": (-500.0, 500.0) for i in range(1, 7)}}
    model.write(tmp_path / "model.yaml")
    read = compd.open_model(tmp_path / "model.yaml", machine)
    assert all(number.plausible for number in read.numbers())
    with pytest.raises(CompdError, match="no effect's parameter"):
        compd.add_effect(None, "link_zero", compd.open_recording(recording, machine, ranges=["link_zero.q=0..1mm"]))
