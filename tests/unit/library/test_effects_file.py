"""Effects of one's own, from files: what is read, what is refused, and that a model file keeps them."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from compd.errors import CompdError, ConfigurationError
from compd.model.library import beside_library, gather_effects, load_effects, named_effect

STAGE = """\
- id: stage_offset
  port: reference
  axis: x
  formula: "c"
  parameters: {c: {unit: um, plausible: [-500, 500], source: homing}}
- id: stage_gain
  port: reference
  axis: x
  formula: "k * position_mm"
  parameters: {k: {unit: um/mm, plausible: [-1, 1], source: lead}}
"""
ONE = """\
id: growth
port: reference
axis: z
formula: "k * (temperature_ram_degC - 20)"
parameters: {k: {unit: um/K, plausible: [-12, 12], source: drawing}}
"""
PYTHON = """\
from dataclasses import replace
from compd.model.library.link import EFFECTS
MINE = replace(EFFECTS[0], id="mine")
AGAIN = MINE
OTHER = replace(EFFECTS[0], id="other")
NOT_ONE = 3
"""


def indented(text: str) -> str:
    return "effects:\n" + textwrap.indent(text, "  ")


@pytest.mark.parametrize(
    ("text", "ids"),
    [(STAGE, ["stage_offset", "stage_gain"]), (indented(STAGE), ["stage_offset", "stage_gain"]), (ONE, ["growth"])],
)
def test_a_list_a_mapping_and_a_single_effect(tmp_path: Path, text: str, ids: list[str]) -> None:
    file = tmp_path / "stage.yaml"
    file.write_text(text)
    assert list(load_effects(str(file))) == ids


def test_every_problem_of_every_effect_at_once_with_file_line_and_key(tmp_path: Path) -> None:
    file = tmp_path / "stage.yaml"
    wrong = STAGE.replace("plausible: [-500, 500], ", "").replace('axis: x\n  formula: "k', 'axs: x\n  formula: "k')
    file.write_text(
        wrong + "- 7\n" + "- {id: cheat, port: reference, axis: x, formula: reference_x_mm * k,\n"
        "   parameters: {k: {unit: um, plausible: [-1, 1], source: s}}}\n"
    )
    with pytest.raises(ConfigurationError) as refused:
        load_effects(file)
    said = [str(problem) for problem in refused.value.problems]
    assert len(said) == 4
    assert said[0].startswith(f"{file}:1 effects[1], parameters.c.plausible: is missing")
    assert said[1].startswith(f"{file}:6 effects[2], axs: unknown key")
    assert "did you mean `axis`?" in said[1]
    assert f"{file}:11 effects[3]: is no effect" in said[2]
    assert "effects[4], formula of cheat, character 1" in said[3]
    assert "would show the effect the answer" in said[3]


def test_a_directory_reads_all_its_files_and_reports_the_problems_of_all(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(STAGE)
    (tmp_path / "b.yml").write_text(ONE)
    (tmp_path / "c.py").write_text(PYTHON)
    (tmp_path / "c.py").chmod(0o644)
    (tmp_path / "notes.txt").write_text("no effects")
    assert list(load_effects(tmp_path)) == ["stage_offset", "stage_gain", "growth", "mine", "other"]
    (tmp_path / "a.yaml").write_text(STAGE.replace("source: lead", "sauce: lead"))
    (tmp_path / "d.yaml").write_text("7")
    with pytest.raises(ConfigurationError) as refused:
        load_effects(tmp_path)
    assert [Path(str(problem.where).split(":", maxsplit=1)[0]).name for problem in refused.value.problems] == [
        "a.yaml",
        "a.yaml",
        "d.yaml",
    ]


def test_an_id_is_taken_once(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(ONE)
    (tmp_path / "b.yaml").write_text(ONE)
    with pytest.raises(ConfigurationError, match=r"b\.yaml: this id is taken, by .*a\.yaml"):
        load_effects(tmp_path)
    assert list(gather_effects(tmp_path / "a.yaml")) == ["growth"]


def test_an_effect_of_ones_own_takes_the_place_of_the_librarys(tmp_path: Path) -> None:
    (tmp_path / "b.yaml").write_text(ONE.replace("growth", "link_zero"))
    own = gather_effects([tmp_path / "b.yaml"])
    every = {effect.id: effect for effect in beside_library(own)}
    assert every["link_zero"] is own["link_zero"]
    assert len(every) == len(beside_library({}))


def test_effects_of_a_python_file_are_declared_by_its_absolute_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path("mine.py")
    file.write_text(PYTHON)
    file.chmod(0o644)
    effects = load_effects("mine.py")
    assert {name: effect.declared for name, effect in effects.items()} == {
        "mine": f"{tmp_path}/mine.py:MINE",
        "other": f"{tmp_path}/mine.py:OTHER",
    }
    assert named_effect("mine.py:OTHER", "here").declared == f"{tmp_path}/mine.py:OTHER"
    file.write_text("NOT_ONE = 3\n")
    with pytest.raises(CompdError, match="holds no effect"):
        load_effects(file)


def test_an_effect_is_named_by_its_file_and_id(tmp_path: Path) -> None:
    stage, one = tmp_path / "stage.yaml", tmp_path / "one.yaml"
    stage.write_text(STAGE)
    one.write_text(ONE)
    assert named_effect(str(one), "here").id == "growth"
    assert named_effect(f"{stage}:stage_gain", "here").id == "stage_gain"
    assert named_effect("stage_gain", "here", load_effects(stage)).id == "stage_gain"
    assert named_effect("link_zero", "here").id == "link_zero"
    with pytest.raises(CompdError, match="which one") as refused:
        named_effect(str(stage), "here")
    assert "stage_offset, stage_gain" in str(refused.value)
    with pytest.raises(CompdError, match="no such effect in this file"):
        named_effect(f"{stage}:stage_bow", "here")
    with pytest.raises(CompdError, match="no file of effects of this name"):
        named_effect("no-such-library:an", "here")
    with pytest.raises(CompdError, match="no such effect") as refused:
        named_effect("stage_bow", "here", load_effects(stage))
    assert "stage_gain" in str(refused.value)


def test_what_is_no_file_of_effects_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "empty.yaml").write_text("effects:\n")
    (tmp_path / "nothing").mkdir()
    for source, said in (
        (tmp_path / "absent.yaml", "cannot be read"),
        (tmp_path / "notes.txt", "is no file of effects"),
        (tmp_path / "empty.yaml", "holds no effects"),
        (tmp_path / "nothing", "holds no file of effects"),
        ("no-such-library", "comes with compd"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            load_effects(source)
