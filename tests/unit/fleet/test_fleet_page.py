"""What is said of a fleet, and the page that says it."""

from __future__ import annotations

from pathlib import Path

from plotly.graph_objects import Figure

from compd.fleet.criteria import FleetCriteria
from compd.fleet.effect_matrix import SELDOM, plot_effect_matrix
from compd.fleet.fleet_figures import plot_drifts
from compd.fleet.fleet_page import write_fleet_page
from compd.fleet.overview import Overview
from compd.fleet.recording_result import NOT_DONE, FleetEstimate
from tests.support.fleets import expansion, machine, result

ALIKE = [1.10, 1.12, 1.09, 1.11, 1.08, 1.13, 1.10]
FLEET = [
    *(campaign for k, value in enumerate(ALIKE) for campaign in machine(f"tripod-{k:02d}", [value] * 3)),
    *machine("tripod-08", [1.0, 1.2, 1.4]),
    *machine("tripod-09", [4.0, 4.0, 4.0]),
    result("tripod-10", 0),
    result("tripod-10", 1, [expansion(1.1, rivals=("scale_expansion",))]),
    result("tripod-11", 0, problem="lost.csv: <cannot> be read"),
]


def test_what_is_to_be_looked_at_is_said() -> None:
    overview = Overview(FLEET)
    assert overview.headline == (
        "29 recordings of 10 machines examined; 1 other could not be. 9 machines have effects, 1 parameter drifts and "
        "1 machine differs."
    )
    (drift,) = overview.drift_sentences()
    assert drift == (
        "tripod-08: link_expansion.a changes by 0.400 +- 0.028 ppm/K from 2026-01-05 to 2026-01-19 (3 values)"
    )
    assert any(text.startswith("tripod-09: link_expansion.a is 4.0") for text in overview.outlying_sentences())
    assert overview.counts("tripod-10") == {"link_expansion": 1}


def test_a_quiet_fleet_has_nothing_to_be_looked_at() -> None:
    overview = Overview(machine("tripod-01", [1.1, 1.1, 1.1]))
    assert overview.headline == "3 recordings of 1 machine examined. 1 machine has an effect."
    assert overview.drift_sentences() == overview.outlying_sentences() == []


def test_machines_that_want_no_look_share_a_line(tmp_path: Path) -> None:
    results = [
        *(result(f"m{k}", campaign) for k in range(6) for campaign in range(2)),
        *machine("m7", [1.1, 1.1]),
        result("m8", 0, verdict="unexplained"),
    ]
    overview = Overview(results)
    assert overview.quiet == [f"m{k}" for k in range(6)]
    assert overview.unexplained == {"m8": 1}
    assert overview.unexplained_sentences() == [
        "m8: an error of 0.50 um has a cause that is not known (on 1 of its 1 recording)"
    ]
    assert overview.outlying_sentences() == ["m7: alone of 8 machines has link_expansion (on 2 of its 2 recordings)"]
    figure = plot_effect_matrix(overview)
    assert isinstance(figure, Figure)
    (matrix,) = figure.data
    assert list(matrix.x) == ["link_expansion<br>ppm/K", "not explained"]
    assert list(matrix.y) == ["m7", "m8"]
    assert [list(row) for row in matrix.text] == [["1.1", ""], ["", "1 of 1"]]
    write_fleet_page(tmp_path / "fleet.html", results)
    assert "6 without any of these: m0, m1, m2" in (tmp_path / "fleet.html").read_text(encoding="utf-8")


def test_the_matrix_says_what_drifts_and_what_differs() -> None:
    figure = plot_effect_matrix(Overview(FLEET))
    assert isinstance(figure, Figure)
    (matrix,) = figure.data
    texts = dict(zip(matrix.y, [row[0] for row in matrix.text], strict=True))
    colours = dict(zip(matrix.y, [row[0] for row in matrix.z], strict=True))
    assert texts["tripod-08"] == "1 to 1.4"
    assert texts["tripod-09"] == "4"
    assert texts["tripod-10"] == "1 of 2 ?"
    assert len({colours[f"tripod-{k:02d}"] for k in (0, 8, 9, 10)}) == 4


def test_effects_that_are_seldom_found_share_a_column() -> None:
    rare = FleetEstimate("backlash", "b", 1.0, 0.01, "um", 0.001, True)
    results = [
        *machine("m1", [1.0, 1.0]),
        result("m1", 2, [expansion(1.0), rare]),
        result("m2"),
        result("m2", 1, [rare]),
    ]
    figure = plot_effect_matrix(Overview(results))
    assert isinstance(figure, Figure)
    (matrix,) = figure.data
    assert list(matrix.x) == ["link_expansion<br>ppm/K", SELDOM]
    assert [list(row) for row in matrix.text] == [["1", "1 of 3"], ["", "1 of 2"]]


def test_a_parameter_that_drifts_has_the_first_figure() -> None:
    lone = FleetEstimate("backlash", "b", 1.0, 0.01, "um", 0.001, True)
    figure = plot_drifts(Overview([*FLEET, *(result("tripod-00", k, [lone]) for k in (7, 8, 9))]))
    assert isinstance(figure, Figure)
    assert [title.text for title in figure.layout.annotations] == ["link_expansion.a", "backlash.b"]


def test_the_page_has_it_all(tmp_path: Path) -> None:
    path = tmp_path / "fleet.html"
    write_fleet_page(path, FLEET)
    text = path.read_text(encoding="utf-8")
    assert "1 of 2 ?" in text
    assert "lost.csv: &lt;cannot&gt; be read" in text
    assert "tripod-08: link_expansion.a changes by" in text
    assert "https://" not in text.partition("<body>")[2]


def test_other_criteria_are_handed_on(tmp_path: Path) -> None:
    strict = FleetCriteria(drift_p_value=1e-300, outlying_score=1e6, steady_share=1.0, fewest_machines=100)
    assert Overview(FLEET).sentences()
    assert Overview(FLEET, strict).drift_sentences() == Overview(FLEET, strict).outlying_sentences() == []
    path = tmp_path / "fleet.html"
    write_fleet_page(path, FLEET, strict)
    assert "it takes 100 machines" in path.read_text(encoding="utf-8")


def test_a_fleet_of_problems_is_a_page_too(tmp_path: Path) -> None:
    write_fleet_page(tmp_path / "fleet.html", [result("", 0, problem="cannot be read")])
    assert "no effect was found" in (tmp_path / "fleet.html").read_text(encoding="utf-8")


def test_what_nobody_has_looked_at_is_no_failure() -> None:
    overview = Overview([result("m1"), result("m1", 1, problem=f"a.csv: {NOT_DONE}"), result("m1", 2, problem="lost")])
    assert overview.headline == "1 recording of 1 machine examined; 1 other could not be; 1 is not done yet."
    assert len(overview.failed) == 1
