"""`compd model effects` and `compd model effect`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from compd.cli.measurements.model.effect import effect as command
from compd.errors import CompdError
from compd.model.library import BUNDLED
from compd.report.effect_signature import compute_signature
from tests.support.effect_rows import DETAILS, HEXAPOD, LIBRARY, TRIPOD
from tests.support.hidden_effects import record_with_effects
from tests.support.paths import CONFIG


def test_the_list_holds_every_effect() -> None:
    result = CliRunner().invoke(command, ["effects"], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    for effect in BUNDLED:
        assert effect.id in result.output
    assert "temperature_link_{link}_degC" in result.output


def test_the_card_says_everything_and_the_page_is_drawn(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    result = CliRunner().invoke(
        command,
        ["effect", "link_expansion_lag", "--machine", str(CONFIG / "tripod-cmm.yaml"), "--html", str(page)],
        env={"COLUMNS": "200"},
    )
    assert result.exit_code == 0
    for text in ("tau dy_i/dt = dT_link_i - y_i", "link_expansion, reference_drift", "0 to 23", "60 to 30000"):
        assert text in result.output
    text = page.read_text(encoding="utf-8")
    assert '"type":"cone"' in text
    assert "the temperature steps after one hour" in text
    assert "https://" not in text.split("</script>")[-1]


def test_the_card_says_what_the_machine_lacks() -> None:
    result = CliRunner().invoke(
        command, ["effect", "joint_runout", "--machine", str(CONFIG / "hexapod.yaml")], env={"COLUMNS": "200"}
    )
    assert result.exit_code == 0
    assert "only a tripod" in result.output


TILT = """\
- id: tilt
  port: reference
  formula: {x: "-k * sin(azimuth_deg * deg)", y: "k * cos(azimuth_deg * deg)"}
  physics: The axis is not vertical.
  parameters: {k: {unit: um, plausible: [-100, 100], source: a level}}
- {id: offset, port: reference, axis: x, formula: c, parameters: {c: {unit: um, plausible: [-1, 1], source: homing}}}
"""


def printed(*arguments: object) -> str:
    result = CliRunner().invoke(command, [str(argument) for argument in arguments], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.exception
    return result.output


def test_effects_of_a_file_are_listed_and_shown(tmp_path: Path) -> None:
    file = tmp_path / "mount.yaml"
    file.write_text(TILT)
    listed = printed("effects", "--effects", file)
    assert "tilt" in listed
    assert "offset" in listed
    assert "link_expansion" not in listed
    for arguments in (["effect", f"{file}:tilt"], ["effect", "tilt", "--effects", file]):
        card = printed(*arguments)
        assert "delta_y = k * cos(azimuth_deg * deg)" in card
        assert "needs         azimuth_deg" in card
        assert "tripod-cmm" not in card, "nobody named a machine"
    assert "on tripod-cmm" in printed("effect", f"{file}:tilt", "--machine", CONFIG / "tripod-cmm.yaml")
    refused = CliRunner().invoke(command, ["effect", str(file)])
    assert isinstance(refused.exception, CompdError)
    assert "holds several effects: which one?" in str(refused.exception)
    one = tmp_path / "one.yaml"
    one.write_text(TILT.split("- {id: offset", maxsplit=1)[0].replace("\n  ", "\n").removeprefix("- "))
    assert "The axis is not vertical." in printed("effect", one)


@pytest.mark.parametrize("effect", BUNDLED, ids=lambda effect: effect.id)
def test_every_effect_has_a_signature(effect: object) -> None:
    one = next(candidate for candidate in BUNDLED if candidate is effect)
    for model in (TRIPOD, HEXAPOD):
        if "revolute_axes" in one.needs and model is HEXAPOD:
            with pytest.raises(CompdError, match="only a tripod"):
                compute_signature(one, model, DETAILS)
            continue
        found = compute_signature(one, model, DETAILS)
        assert np.isfinite(found.tip_um).all()
        assert np.linalg.norm(found.tip_um, axis=1).max() > 1e-3
        assert found.curves
        assert all(np.isfinite(curve.tip_um).all() for curve in found.curves)
        assert any(np.ptp(curve.tip_um, axis=0).max() > 0 for curve in found.curves)


def test_the_hysteresis_curve_is_a_loop() -> None:
    found = compute_signature(LIBRARY["friction_hysteresis"], TRIPOD, DETAILS)
    path_mm, tip_um = found.curves[0].driven_by, found.curves[0].tip_um[:, 0]
    middle = np.flatnonzero(np.abs(path_mm) < 1e-9)
    there, back, again = tip_um[middle]
    assert abs(there - back) > 1.0
    assert there == pytest.approx(again, abs=1e-6)


def add_formula(directory: Path, formula: str) -> str:
    """What `compd model add` of a formula says, of 30 rows with a temperature that changes."""
    (directory / "mine.yaml").write_text(
        f"{{id: mine, port: link, formula: {formula}, physics: Grows., "
        "parameters: {k: {unit: um/K, plausible: [-10, 10], source: mine}}}"
    )
    recording = directory / "run.csv"
    record_with_effects(recording, 1, {})
    arguments = [
        "add",
        str(directory / "mine.yaml"),
        "--recording",
        str(recording),
        "--model",
        str(directory / "m.yaml"),
    ]
    result = CliRunner().invoke(command, arguments)
    assert isinstance(result.exception, CompdError)
    return str(result.exception)


def test_a_quantity_without_its_unit_or_misspelt_is_asked_back(tmp_path: Path) -> None:
    assert "did you mean temperature_room_degC?" in add_formula(tmp_path, "k * temperature_room")
    assert "did you mean temperature_room_degC?" in add_formula(tmp_path, "k * temprature_room_degC")
    assert "did you mean" not in add_formula(tmp_path, "k * voltage_V")


@pytest.mark.filterwarnings("error")
def test_a_formula_that_has_no_value_is_named_and_numpy_says_nothing(tmp_path: Path) -> None:
    text = add_formula(tmp_path, "k * exp(1000 * temperature_room_degC)")
    assert "mine has no finite value in " in text
    assert "exp of a large number" in text
