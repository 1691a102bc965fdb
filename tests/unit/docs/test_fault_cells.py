"""The pages of faults and of blind spots show what `make faults` has measured, where it has."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from docs.generate import blind_spots, faults
from docs.generate.fault_cells import measured
from tests.injection.cells.cell import all_cells
from tests.injection.cells.situation import Situation
from tests.injection.measured import SHOWN, write

FIGURES: dict[str, Any] = {"most": 0.5, "beyond": 0, "setpoints": 300, "reasons": ["none of the page's business"]}


def result(names: list[str], situation: str, worst_um: float | None, bound_um: float | None, **more: Any) -> Any:
    figures = {"faults": names, "situation": situation, "worst_um": worst_um, "worst_bound_um": bound_um}
    return FIGURES | figures | more


def pair(situation: Situation) -> list[str]:
    """The first that is drawn with this situation."""
    cells = (cell for cell in all_cells() if len(cell.cases) == 2 and cell.situation is situation)
    return [case.id for case in next(cells).cases]


BEYOND, WITHIN = pair(Situation.RESTART), pair(Situation.LOAD)
RESULTS = [
    result([], "rest", 0.31, 0.62),
    result(["scale-jumps"], "motion", 512.0, 1024.0),
    result(["scale-jumps"], "rest", None, None),
    result(["scale-inch-at-zero"], "motion", 10_158.4, 0.7, most=1e4, beyond=200),
    result(BEYOND, "restart", 3.0, 2.0, most=1.5, beyond=7),
    result(WITHIN, "load", 0.2, 0.6),
]


def document(tmp_path: Path) -> Any:
    """As the run writes it, beside the outcomes that the file had."""
    path = tmp_path / "faults.json"
    path.write_text('{"command": "before", "outcomes": {"scale-jumps": {"worst_um": 7.5}}}')
    write(path, [], RESULTS)
    return json.loads(path.read_text())


def row(page: str, fault: str) -> list[str]:
    (line,) = (line for line in page.split("\n") if line.startswith(f"| {fault}<br>"))
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def test_a_fault_has_its_error_and_bound_in_each_situation(tmp_path: Path) -> None:
    page = faults.page_of(document(tmp_path))
    jumps = row(page, "a scale jumps and stays there")
    assert jumps[2] == "seen<br>at rest: none valid<br>in motion: 512 um of 1024 um"
    inches = row(page, "a display is switched to inches at machine zero")
    assert inches[2].startswith(
        "not seen: [display parameters at zero](#blind-spots-display-parameters-at-zero)<br>in motion: 10158"
    )
    assert "Without a fault: at rest: 0.31 um of 0.62 um." in page


def test_pairs_that_are_beyond_their_bound_are_named(tmp_path: Path) -> None:
    page = faults.page_of(document(tmp_path))
    assert "2 pairs of faults were drawn" in page
    assert f"| {' + '.join(BEYOND)} | restarted: 3.00 um of 2.00 um | 7 | 300 |" in page
    assert " + ".join(WITHIN) not in page


def test_a_blind_spot_has_the_number_of_what_was_injected(tmp_path: Path) -> None:
    page = blind_spots.page_of(document(tmp_path))
    spot = page.partition("(blind-spots-display-parameters-at-zero)=")[2].partition("\n(")[0]
    assert "*Measured:* scale 1 shows inches from 0 on; all links drive: in motion: 10158 um of 0.70 um" in spot
    assert page.count("*Measured:*") == 1


def test_the_file_keeps_what_the_page_shows_and_what_another_run_wrote(tmp_path: Path) -> None:
    written = document(tmp_path)
    assert written["outcomes"] == {"scale-jumps": {"worst_um": 7.5}}
    write(tmp_path / "faults.json", [], [result(["scale-jumps"], "rest", 0.5, 0.6)])
    again = json.loads((tmp_path / "faults.json").read_text())
    assert len(again["cells"]) == len(written["cells"])
    assert [cell["worst_um"] for cell in again["cells"] if cell["faults"] == ["scale-jumps"]] == [0.5, 512.0]
    assert set(written["cells"][0]) == set(SHOWN)
    assert written["command"].startswith("make faults OPTIONS=")


def test_without_such_a_run_the_pages_have_no_such_figures() -> None:
    without = {key: value for key, value in measured().items() if key != "cells"}
    assert "error of bound" not in faults.page_of(without)
    assert "Measured:" not in blind_spots.page_of(without)
