"""What is said of a fleet, and the page that says it."""

from __future__ import annotations

from pathlib import Path

from compd.fleet.fleet_page import write_fleet_page
from compd.fleet.overview import Overview
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
        "29 recordings of 10 machines examined; 1 other could not be. 1 parameter drifts and 1 machine differs."
    )
    (drift,) = overview.drift_sentences()
    assert drift == (
        "tripod-08: link_expansion.a changes by 0.400 +- 0.028 ppm/K from 2026-01-05 to 2026-01-19 (3 values)"
    )
    assert any(text.startswith("tripod-09: link_expansion.a is 4.0") for text in overview.outlying_sentences())
    assert overview.counts("tripod-10") == {"link_expansion": 1}


def test_a_quiet_fleet_has_nothing_to_be_looked_at() -> None:
    overview = Overview(machine("tripod-01", [1.1, 1.1, 1.1]))
    assert overview.headline == "3 recordings of 1 machine examined."
    assert overview.drift_sentences() == overview.outlying_sentences() == []


def test_the_page_has_it_all(tmp_path: Path) -> None:
    path = tmp_path / "fleet.html"
    write_fleet_page(path, FLEET)
    text = path.read_text(encoding="utf-8")
    assert "1 of 2 ?" in text
    assert "lost.csv: &lt;cannot&gt; be read" in text
    assert "tripod-08: link_expansion.a changes by" in text
    assert "https://" not in text.partition("<body>")[2]


def test_a_fleet_of_problems_is_a_page_too(tmp_path: Path) -> None:
    write_fleet_page(tmp_path / "fleet.html", [result("", 0, problem="cannot be read")])
    assert "no effect was found" in (tmp_path / "fleet.html").read_text(encoding="utf-8")
