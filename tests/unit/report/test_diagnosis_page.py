"""The page of a diagnosis: twelve lines first, pictures that can be read, formulas that can be pasted."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from plotly.graph_objects import Figure

from compd.comparison import AlignedRecording, Covariate, compare
from compd.diagnosis import CandidateResult, Diagnosis, ErrorFall, error_fall, summary_lines
from compd.diagnosis.findings import GrossRows, UntestedEffect
from compd.model.effects import FittedEffect
from compd.model.library import find_effect
from compd.report.diagnosis_page import plot_time, write_diagnosis_page
from compd.report.falling_error import NAME_WIDTH, plot_falling_error
from compd.report.small_multiples import axis_title, axis_unit
from compd.report.step_figure import plot_step
from compd.text import typeset
from tests.support.diagnoses import (
    FRAME,
    Noise,
    described_by_two,
    description,
    diagnosis,
    external_recording,
    formula,
    step,
)
from tests.support.measured import aligned as align_tripod
from tests.support.measured import gauges, hidden, record

FALL = ErrorFall(1.0, (0.2,), 0.2, 0.15, "repeats", "arcsec", left_out=True)
LONG = "a_name_of_an_effect_that_is_longer_than_the_room_beside_a_bar"


def texts(figure: Figure) -> str:
    """Every text of a figure."""
    return figure.to_json()


@pytest.fixture(scope="module")
def tripod(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    return align_tripod(record(tmp_path_factory.mktemp("run"), gauges(300, 5)))


def step_figure(recording: AlignedRecording, *effects: FittedEffect) -> Figure:
    numbers = sum(len(fitted.theta) for fitted in effects)
    return plot_step(compare(recording, effects, np.zeros((numbers, numbers))), effects, FALL)[0]


def described() -> Diagnosis:
    return described_by_two('It\'s a description: "no" cause, & nothing < or > than that.')


def page_of(made: Diagnosis, tmp_path: Path) -> str:
    write_diagnosis_page(tmp_path / "page.html", made, [], shared_script=True)
    return (tmp_path / "page.html").read_text(encoding="utf-8")


def test_the_page_begins_with_the_lines_of_the_terminal(tmp_path: Path) -> None:
    page = page_of(described(), tmp_path)
    first = page.partition("<pre")[2].partition("</pre>")[0]
    lines = [typeset(line) for line in summary_lines(described())]
    assert first.replace("&gt;", ">").split(">", 1)[1].split("\n") == lines


def test_formulas_pasted_from_the_source_are_a_file_of_effects(tmp_path: Path) -> None:
    page = page_of(described(), tmp_path)
    (source,) = [text for text in re.findall(r"<pre>(.*?)</pre>", page, re.DOTALL) if "formula:" in text]
    assert "\N{NO-BREAK SPACE}" not in page
    assert "It''s a description: \"no\" cause, &amp; nothing &lt; or &gt; than that." in " ".join(source.split())
    entries = yaml.safe_load(source)
    assert [find_effect(entry, "pasted").id for entry in entries] == [
        "reference_follows_temperature_frame_degc_linear_x",
        "reference_follows_temperature_bed_degc_linear_x",
    ]


def test_the_description_is_drawn_with_and_without_each_covariate(tmp_path: Path) -> None:
    page = page_of(described(), tmp_path)
    assert [f"With and without {name}" in page for name in FRAME] == [True, True]


def test_a_machine_with_a_model_of_its_own_is_told_of_nothing_inside_another(tmp_path: Path) -> None:
    candidates = [CandidateResult("my_growth", "no_gain", "takes 0 % of the error away")]
    untested = [UntestedEffect("plate_bending", "acts inside a machine"), UntestedEffect("link_sag", "acts inside")]
    page = page_of(replace(described(), candidates=tuple(candidates), untested=tuple(untested)), tmp_path)
    assert "my_growth" in page
    assert "plate_bending" not in page
    assert "link_sag" not in page


def test_small_ends_of_the_falling_error_can_be_read_whatever_the_names() -> None:
    effects = [formula(f"{LONG}_{k}", "b * position_mm", "It is long.") for k in range(3)]
    steps = [step(effect, [1.0], 0.1, left, links=0) for effect, left in zip(effects, (90.0, 9.0, 0.9), strict=True)]
    made = diagnosis("partial", 900.0, 0.9, Noise(0.5), external_recording(), steps=steps)
    figure = plot_falling_error(made, [], error_fall(made))
    assert figure.layout.xaxis.type == "log"
    names = list(figure.data[0].y)
    assert max(len(line) for name in names for line in name.split("<br>")) <= NAME_WIDTH
    assert [name.replace("<br>", "").replace("with ", "").replace("and ", "") for name in names[1:]] == [
        effect.id for effect in effects
    ]
    assert [text.strip() for text in figure.data[1].text] == [f"<b>{t} um</b>" for t in ("900", "90", "9.0", "0.90")]
    low, high = (10**end for end in figure.layout.xaxis.range)
    assert low < 0.5
    assert high > 900
    (band,) = figure.layout.shapes
    assert (band.type, band.x1) == ("rect", 0.5)


def test_without_a_known_noise_there_is_no_band() -> None:
    made = diagnosis("not_testable", 9.0, 9.0, Noise(0.5, "estimate"), external_recording())
    assert not plot_falling_error(made, [], error_fall(made)).layout.shapes


def test_a_step_is_drawn_before_and_after_on_one_scale_with_its_curve(tripod: AlignedRecording) -> None:
    figure = step_figure(tripod, hidden("link_elasticity", 20.0))
    axes = [figure.layout[name] for name in ("yaxis", "yaxis2")]
    assert axes[1].matches == "y"
    assert axes[0].range == axes[1].range
    curves = [trace for trace in figure.data if trace.line.color == "black"]
    assert [trace.xaxis for trace in curves] == ["x", "x3", "x5"]  # on the left, one for each link
    slope = np.polyfit(curves[0].x, curves[0].y, 1)[0]
    assert slope == pytest.approx(1 / 20.0, rel=0.01)
    assert "axial force in link 1, N" in texts(figure)
    assert "error of link 1, arcsec" in texts(figure)


def test_after_minus_before_is_what_the_effect_does(tripod: AlignedRecording) -> None:
    figure = step_figure(tripod, hidden("tool_offset", 3.0, 0.0, 0.0))
    before, after, *_ = (trace for trace in figure.data if trace.mode == "markers")
    assert (before.xaxis, after.xaxis) == ("x", "x2")
    assert np.mean(before.y) - np.mean(after.y) == pytest.approx(3.0, abs=0.1)
    assert "error of x, arcsec" in texts(figure)


def test_a_direction_is_drawn_as_boxes_in_words(tripod: AlignedRecording) -> None:
    figure = step_figure(tripod, hidden("backlash", 2.0, 2.0, 2.0))
    assert {trace.type for trace in figure.data} == {"box"}
    assert {trace.name for trace in figure.data} == {"shortening", "lengthening"}


def test_a_column_that_ends_in_a_number_is_no_direction_of_a_link() -> None:
    recording = external_recording(direction=True)
    play = formula("stage_backlash", "b * moved_1", "Play.")
    figure = step_figure(recording, FittedEffect(play, np.array([2.0])))
    assert {trace.name for trace in figure.data} == {"-1", "1"}
    assert "shortening" not in texts(figure)
    assert axis_unit(Covariate("moved", "1", np.zeros(1))) == ""
    assert axis_title(Covariate("direction of link 2", "1", np.zeros(1), 2)) == "direction of link 2"


def test_a_cyclic_effect_is_drawn_against_its_phase(tripod: AlignedRecording) -> None:
    figure = step_figure(tripod, hidden("scale_cyclic", *([0.5] * 3), *([0.0] * 9), p=0.02))
    assert "reading of scale 1 within a period of 0.02 mm, mm" in texts(figure)
    assert max(max(trace.x) for trace in figure.data) <= 0.02


def test_what_has_several_drivers_at_once_is_drawn_against_itself(tripod: AlignedRecording) -> None:
    mixed = formula("mixed", "b * sin(temperature_room_degC * humidity_pct * 50)", "It mixes.")
    figure = step_figure(tripod, FittedEffect(mixed, np.array([2.0])))
    assert "what mixed does, arcsec" in texts(figure)


def test_gross_rows_and_changes_are_marked_in_time() -> None:
    finding = description("time_s", "change", 0.5, 0.9, effect="stage_backlash", time_s=6000.0, formula_effects=())
    made = diagnosis("unexplained", 2.6, 2.6, Noise(0.5), external_recording(), depends_on=[finding])
    made = replace(made, gross=GrossRows((40, 41, 77), ((40, 41),)))
    figure = plot_time(made, error_fall(made))
    crosses = next(trace for trace in figure.data if trace.marker.symbol == "x-thin")
    assert len(crosses.x) == 3
    assert crosses.text[0].startswith("row 40: ")
    (moment,) = figure.layout.shapes
    assert moment.x0 == pytest.approx(6000 / 3600)
    assert "from 6000 s on (row 62) stage_backlash" in texts(figure)


def test_a_page_without_gross_rows_has_no_picture_of_time(tmp_path: Path) -> None:
    assert "Over time" not in page_of(described(), tmp_path)
    assert "Over time" in page_of(replace(described(), gross=GrossRows((40,), ())), tmp_path)


@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_pages_of_one_two_and_three_axes(axes: str, tmp_path: Path) -> None:
    gain = formula("stage_gain", "b * position_mm", "Lead of the screw.")
    fields: dict[str, Any] = {"steps": [step(gain, [1.0], 0.1, 0.3, links=0)]}
    made = diagnosis("identified", 1.3, 0.3, Noise(0.28), external_recording(axes), **fields)
    page = page_of(made, tmp_path)
    assert "1. stage_gain: Lead of the screw." in page
    assert "Drawn where it does most: x" in page or axes == "x"


def test_a_period_that_a_formula_has_as_a_number_is_drawn_as_a_phase() -> None:
    wave = formula("wave", "b * sin(2 * pi * time_s / 1121.22)", "It swings.")
    figure = step_figure(external_recording(), FittedEffect(wave, np.array([2.0])))
    assert "time within a period of 1121 s, s" in texts(figure)
