"""Settings of a delta, read back as each controller reads them, against the machine's own kinematics."""

from __future__ import annotations

import configparser
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from compd.built_machine import FORMS, DeltaSettings, delta_settings, settings_text
from compd.configuration import load
from compd.errors import CompdError
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.model import MachineModel
from tests.unit.built_machine.machines import tips, with_effects

Floats = NDArray[np.float64]
# Scales at which the tip is compared, within the workspace to which the settings are fitted.
SCALES_MM = np.random.default_rng(11).uniform(-25, 25, (60, 3))

# The platform joints of the first tower.
PAIR = ("[30, 35, 0]", "[-30, 35, 0]")


def read_back(controller: str, text: str) -> tuple[Floats, Floats, Floats, Floats]:
    """Towers (3, 2), arms, heights of the carriages at the endstops, and the tilt, as the controller computes them."""
    tilt = np.zeros(2)
    if controller == "klipper":
        file = configparser.RawConfigParser(strict=False, inline_comment_prefixes=(";", "#"))
        file.read_string(text)
        assert file["printer"]["kinematics"] == "delta"
        steppers = [file[f"stepper_{axis}"] for axis in "abc"]
        radius = float(file["printer"]["delta_radius"])
        degrees = np.array([float(one["angle"]) for one in steppers])
        arms = np.array([float(one["arm_length"]) for one in steppers])
        heights = np.array([float(one["position_endstop"]) for one in steppers]) + np.sqrt(arms**2 - radius**2)
        assert float(file["delta_calibrate"]["radius"]) > 0
    elif controller == "reprapfirmware":
        code = {
            line.split()[0]: {word[0]: word[1:] for word in line.split()[1:]}
            for line in text.splitlines()
            if not line.startswith(";")
        }
        radius, arms = float(code["M665"]["R"]), np.array([float(word) for word in code["M665"]["L"].split(":")])
        degrees = np.array([210.0, 330.0, 90.0]) + [float(code["M665"][axis]) for axis in "XYZ"]
        moved = np.array([float(code["M666"][axis]) for axis in "XYZ"])
        heights = float(code["M665"]["H"]) + np.sqrt(arms**2 - radius**2) + moved
        tilt = np.array([float(code["M666"][axis]) for axis in "AB"]) / 100
    else:
        pins = dict(re.findall(r"^setp lineardeltakins\.(\w) (\S+)$", text, re.MULTILINE))
        radius, arms = float(pins["R"]), np.full(3, float(pins["L"]))
        degrees = np.array([90.0, 210.0, 330.0])
        heights = np.array([float(value) for value in re.findall(r"^HOME_OFFSET = (\S+)$", text, re.MULTILINE)])
    angles = np.deg2rad(degrees)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=1), arms, heights, tilt


def remark(text: str, pattern: str) -> list[float]:
    found = re.search(pattern, text)
    assert found, pattern
    return [float(value) for value in found.groups()]


def controller_tips(controller: str, text: str, settings: DeltaSettings, scales_mm: Floats = SCALES_MM) -> Floats:
    """Where the controller takes the tip to be at these scales, in {M}, from the text and its remarks alone."""
    towers, arms, at_endstop, tilt = read_back(controller, text)
    endstops = remark(text, r"scales show (\S+), (\S+), (\S+) mm")
    order = [int(i) - 1 for i in re.findall(r"is actuator (\d)", text)]
    gains = np.ones(3)
    for axis, gain in re.findall(r"Tower (\S+) goes (\S+) times", text):
        gains[settings.form.axes.index(axis)] = float(gain)
    shift = np.array(remark(text, r"origin is at (\S+), (\S+), (\S+) mm"))
    turn = np.deg2rad(remark(text, r"turned by (\S+) degrees")[0]) if "turned by" in text else 0.0
    heights = at_endstop + gains * (scales_mm[:, order] - endstops)
    places = np.array([three_spheres(towers, arms, height, tilt) for height in heights])
    x, y, z = places.T
    return np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=1) + shift


def three_spheres(towers: Floats, arms: Floats, heights: Floats, tilt: Floats) -> Floats:
    """The tip below three carriages, by Newton's method on its equation."""
    tip = np.array([0.0, 0.0, heights.mean() - arms.mean()])
    for _ in range(40):
        level = tip[2] + tilt @ tip[:2]
        away = np.concatenate([tip[:2] - towers, (level - heights)[:, None]], axis=1)
        gradient = away.copy()
        gradient[:, :2] += away[:, 2:] * tilt
        tip = tip - np.linalg.solve(2 * gradient, (away**2).sum(axis=1) - arms**2)
    return tip


def delta(tmp_path: Path, changes: dict[str, str] | None = None) -> MachineModel:
    text = machine_text("mine", "linear-delta", KINDS["linear-delta"].usual)
    for old, new in (changes or {}).items():
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "delta.yaml"
    path.write_text(text, encoding="utf-8")
    configuration = load(path)
    return build_model(configuration.geometry, configuration.wiring)


@pytest.mark.parametrize("controller", FORMS)
def test_the_drawing_is_held_exactly(tmp_path: Path, controller: str) -> None:
    model = delta(tmp_path)
    settings = delta_settings(model, FORMS[controller])
    assert settings.worst_um < 0.01
    assert settings.radius_mm == pytest.approx(155.0, abs=1e-4)
    text = settings_text(controller, settings, "mine")
    assert np.abs(controller_tips(controller, text, settings) - tips(model, SCALES_MM)).max() < 3e-5


@pytest.mark.parametrize("controller", ["klipper", "reprapfirmware"])
def test_a_machine_with_equal_pairs_is_held_exactly(tmp_path: Path, controller: str) -> None:
    # the place of one tower outwards and sideways with its arms, and another tower's height
    changes = {"[30, 190, 0]": "[30.4, 190.7, 0]", "[-30, 190, 0]": "[-29.6, 190.7, 0]"}
    changes |= {f"platform_P_mm: {c}, length_mm: 337.67588": f"platform_P_mm: {c}, length_mm: 338.2" for c in PAIR}
    changes |= {f"{place}, 0]": f"{place}, 1.3]" for place in ("[-179.544827, -69.019238", "[-149.544827, -120.980762")}
    model = delta(tmp_path, changes)
    settings = delta_settings(model, FORMS[controller], bed_M_mm=-400.0, endstop_scale_mm=(60.0, 61.0, 62.0))
    assert settings.worst_um < 0.05
    text = settings_text(controller, settings, "mine")
    assert np.abs(controller_tips(controller, text, settings) - tips(model, SCALES_MM)).max() < 6e-5
    assert sorted(np.round(settings.arm_mm, 3).tolist()) == [337.676, 337.676, 338.2]


@pytest.mark.parametrize("controller", FORMS)
def test_what_the_format_cannot_hold_is_said_as_the_error_that_it_costs(tmp_path: Path, controller: str) -> None:
    model = with_effects(delta(tmp_path), seed=3)
    settings = delta_settings(model, FORMS[controller])
    text = settings_text(controller, settings, "mine")
    rms_um, worst_um = remark(text, r"cannot hold: (\S+) um rms, (\S+) um at most")
    radius_mm, low_mm, high_mm = remark(text, r"within (\S+) mm of the centre, z (\S+) to (\S+) mm of")
    # other places of the same workspace, as many in each ring
    rng = np.random.default_rng(12)
    radius, angle = radius_mm * rng.uniform(0, 1, 80), rng.uniform(0, 2 * np.pi, 80)
    places = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(low_mm, high_mm, 80)], axis=1)
    scales_mm = model.reach(places).scale_mm
    error_mm = controller_tips(controller, text, settings, scales_mm) - tips(model, scales_mm)
    error_um = 1e3 * np.sqrt((error_mm**2).sum(axis=1))
    assert rms_um > 1.0
    assert 0.6 * rms_um < np.sqrt((error_um**2).mean()) < 1.4 * rms_um
    assert error_um.max() < 1.2 * worst_um


def test_a_controller_with_more_settings_errs_less(tmp_path: Path) -> None:
    model = with_effects(delta(tmp_path), seed=4)
    rms = [delta_settings(model, FORMS[name]).rms_um for name in ("reprapfirmware", "klipper", "linuxcnc")]
    assert rms[0] <= rms[1] * 1.001 < rms[2]


def test_another_machine_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "hexaglide.yaml"
    path.write_text(machine_text("mine", "6-pus", KINDS["6-pus"].usual), encoding="utf-8")
    configuration = load(path)
    with pytest.raises(CompdError, match="is no linear delta with upright rails"):
        delta_settings(build_model(configuration.geometry, configuration.wiring), FORMS["klipper"])
