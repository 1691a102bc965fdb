"""What gauges can feign unseen, and what nothing shows, with the numbers of the shipped machines."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compd.commissioning.blind_spots import BLIND_SPOTS
from compd.commissioning.cycle_time import CycleTime, cycle_warnings, measure_cycle, python_effect_times
from compd.commissioning.drift_costs import drift_costs
from compd.commissioning.fault_costs import figures_of
from compd.commissioning.jump_trials import (
    LATE_BUSY_S,
    LATE_S,
    feigned_jumps,
    jump_warnings,
    named_together,
    reply_warnings,
)
from compd.commissioning.line_budget import line_budgets
from compd.configuration import Configuration, load
from compd.gauge import DataSheetNoise, Gauge, GaugeOptions, Quality, Reading, good
from compd.live.acquisition import MotionLimits, ReadingTrust, TrustSettings, unseen_jump_mm
from compd.live.acquisition.possible_motion import WINDOW_S, GaugeSample
from compd.live.memory import TrustMemory
from compd.stated_noise import tolerance_mm
from tests.support.command import run_in_process
from tests.support.live_models import file_with
from tests.support.paths import CONFIG

TRIPOD = (CONFIG / "tripod-cmm.yaml").read_text()


def changed(tmp_path: Path, *pairs: tuple[str, str]) -> Configuration:
    text = TRIPOD
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = tmp_path / "machine.yaml"
    path.write_text(text)
    return load(path)


@pytest.mark.parametrize("name", ["tripod-cmm", "hexapod"])
def test_the_shipped_machines_have_limits_and_no_warnings(name: str) -> None:
    configuration = load(CONFIG / f"{name}.yaml")
    jumps = feigned_jumps(configuration, line_budgets(configuration))
    assert all(0 < jump.quiet.jump_mm < 0.12 and jump.quiet.jump_mm < jump.busy.jump_mm < 1.0 for jump in jumps)
    assert [*jump_warnings(configuration, jumps), *reply_warnings(configuration)] == []


def test_a_jump_is_believed_up_to_acceleration_and_noise(tmp_path: Path) -> None:
    configuration = changed(
        tmp_path,
        (
            "noise_um: 0.035\n    heads: 9\n    acceleration_mm_per_s2: 20",
            "noise_um: 0.5\n    heads: 9\n    acceleration_mm_per_s2: 10",
        ),
    )
    budgets = line_budgets(configuration)
    poll_s = next(budget.usual_s for budget in budgets if budget.name == "joints")
    jump = next(jump for jump in feigned_jumps(configuration, budgets) if jump.gauge == "joints")
    for believed, late_s in ((jump.quiet, LATE_S), (jump.busy, LATE_BUSY_S)):
        assert believed.poll_s == poll_s + late_s
        assert believed.jump_mm == unseen_jump_mm(MotionLimits(acceleration=10), poll_s + late_s, tolerance_mm(0.5))
    assert named_together(jump.measures) == "joint 1 to 9"


@pytest.mark.parametrize("name", ["tripod-cmm", "hexapod"])
@pytest.mark.parametrize("column", ["quiet", "busy"])
def test_a_larger_jump_than_the_table_has_is_never_believed(name: str, column: str) -> None:
    """Readings as far apart as the table says, up to the last digit of the display, in either direction."""
    configuration = load(CONFIG / f"{name}.yaml")
    for jump in feigned_jumps(configuration, line_budgets(configuration)):
        options = configuration.gauges[jump.gauge]
        believed = getattr(jump, column)
        for share in (1.02, 1.5, 10.0, -1.02, -10.0):
            found = after_a_jump(options, believed.poll_s, share * believed.jump_mm)
            assert found.quality is Quality.DISTRUSTED, (jump.gauge, share)
        assert after_a_jump(options, believed.poll_s, 0.5 * believed.jump_mm).ok, "and the table is no guess"


def after_a_jump(options: GaugeOptions, poll_s: float, jump_mm: float) -> Reading:
    """What a gauge's judge makes of a jump of a part at rest that two answers show, the second one exchange later."""
    limits = MotionLimits(options.fastest_mm_per_s or math.inf, options.acceleration_mm_per_s2 or math.inf)
    memory = TrustMemory(["gauge.value"], [tolerance_mm(options.noise_um)])
    trust = ReadingTrust(memory, "gauge.value", TrustSettings(limits, False, 0.5, 0.5))
    for k in range(20):
        reading = good(0.0, 1000.0 + k * poll_s)
        first = None if k else reading
        assert trust.judge(reading, WINDOW_S, first).ok
    first, second = (good(jump_mm, 1000.0 + (k + 20) * poll_s) for k in range(2))
    assert trust.surprises(GaugeSample(first.value, first.time_s, WINDOW_S))
    return trust.judge(second, WINDOW_S, first)


def test_without_a_limit_any_jump_is_believed_and_the_key_is_named(tmp_path: Path) -> None:
    configuration = changed(tmp_path, ("line: scale_1, acceleration_mm_per_s2: 300", "line: scale_1"))
    (warning,) = jump_warnings(configuration, feigned_jumps(configuration, line_budgets(configuration)))
    assert warning.where.endswith("gauges.scale_1")
    assert "any jump of scale 1" in warning.what
    assert "acceleration_mm_per_s2" in warning.next_step


def test_a_limit_that_finds_next_to_nothing_is_warned_of(tmp_path: Path) -> None:
    configuration = changed(tmp_path, ("acceleration_mm_per_s2: 300", "acceleration_mm_per_s2: 30000"))
    (warning,) = jump_warnings(configuration, feigned_jumps(configuration, line_budgets(configuration)))
    assert "a jump of scale 1 of" in warning.what
    assert "30000 mm/s2" in warning.value


@pytest.mark.parametrize(
    ("identities", "warned"),
    [((None, None), True), (("01", None), True), (("01", "01"), True), (("01", "02"), False)],
)
def test_a_line_whose_replies_do_not_say_whose_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, identities: tuple[str | None, str | None], warned: bool
) -> None:
    configuration = changed(tmp_path, ("line: scale_2, acc", "line: scale_1, acc"))
    of = dict(zip(("scale_1", "scale_2"), identities, strict=True))
    gauges = configuration.gauge_objects()
    for name, gauge in gauges.items():
        monkeypatch.setattr(type(gauge), "reply_identity", Gauge.reply_identity)
        if name in of:
            kind = type(name, (type(gauge),), {"reply_identity": property(lambda _, name=name: of[name])})
            gauges[name] = kind(gauge.options)
    monkeypatch.setattr(Configuration, "gauge_objects", lambda _: gauges)
    warnings = reply_warnings(configuration)
    assert bool(warnings) == warned
    if warned:
        assert warnings[0].where.endswith("lines.scale_1")


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["joint 1", "joint 2", "joint 3"], "joint 1 to 3"),
        (["frame u1", "frame u2", "frame u3", "frame t1"], "frame u1 to u3, frame t1"),
        (["scale 1", "scale 2"], "scale 1, scale 2"),
        (["joint 9", "joint 10", "joint 11"], "joint 9 to 11"),
    ],
)
def test_names_are_drawn_together(names: list[str], words: str) -> None:
    assert named_together(names) == words


def test_a_drift_costs_what_the_kinematics_says() -> None:
    """The tripod's tip is 60 mm below its platform: 10 um of one scale are 15 um there, in both modes."""
    costs = {cost.length: cost for cost in drift_costs(load(CONFIG / "tripod-cmm.yaml"))}
    assert len(costs) == 3 + 9 + 9
    assert costs["scale 1"].cmm_um == pytest.approx(15.0, abs=0.1)
    assert costs["joint 2"].cmm_um == pytest.approx(costs["joint 1"].cmm_um / 2, rel=1e-3), "Ra counts half"
    np.testing.assert_allclose(
        [c.cmm_um for c in costs.values()], [c.machine_tool_um for c in costs.values()], rtol=1e-3
    )


def test_every_blind_spot_says_what_remains() -> None:
    figures = figures_of(load(CONFIG / "hexapod.yaml"))
    assert len({spot.name for spot in BLIND_SPOTS}) == len(BLIND_SPOTS)
    for spot in BLIND_SPOTS:
        assert spot.fault
        assert spot.unseen
        assert "nan" not in spot.cost(figures)


@pytest.mark.parametrize("name", ["tripod-cmm", "hexapod"])
def test_lost_signal_periods_and_scatter_have_their_numbers(name: str) -> None:
    configuration = load(CONFIG / f"{name}.yaml")
    gauges = {g: options.model_copy(update={"noise_um": None}) for g, options in configuration.gauges.items()}
    gauges["scale_1"] = gauges["scale_1"].model_copy(update={"noise_um": 0.1})
    figures = figures_of(replace(configuration, gauges=gauges))
    step_um = 1e3 * next(jump.quiet.jump_mm for jump in figures.jumps if jump.gauge == "scale_1")
    cost = {spot.name: spot.cost(figures) for spot in BLIND_SPOTS}
    assert f"20 um that is lost: {20 * figures.leverage('scale'):.3g} um at the tip" in cost["lost_signal_periods"]
    assert f"one step at rest: {step_um:.3g}" in cost["lost_signal_periods"]
    assert cost["scatter"].startswith(f"scale_1: 0.2 um, {0.2 * figures.leverage('scale'):.3g} um at the tip")
    assert "no `noise_um`, so that any scatter passes: scale_2, " in cost["scatter"]


def test_scatter_is_judged_by_the_data_sheet_where_the_configuration_says_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    gauges = {g: options.model_copy(update={"noise_um": None}) for g, options in configuration.gauges.items()}
    monkeypatch.setattr(configuration.drivers["scale_1"], "noise", DataSheetNoise(0.05, "page 5"))
    figures = figures_of(replace(configuration, gauges=gauges))
    (cost,) = [spot.cost(figures) for spot in BLIND_SPOTS if spot.name == "scatter"]
    assert cost.startswith(f"scale_1: 0.1 um, {0.1 * figures.leverage('scale'):.3g} um at the tip")
    assert "scale_1" not in cost.partition("any scatter passes")[2]


def test_the_command_prints_both() -> None:
    printed = run_in_process("check", "--what-cannot-be-seen", str(CONFIG / "tripod-cmm.yaml"))
    assert "A drift of 10 um" in printed
    assert "two scales 1 mm apart: up to 2.52 mm" in printed


def test_a_rate_that_this_computer_cannot_keep(tmp_path: Path) -> None:
    configuration = changed(tmp_path, ("rate_hz: 200", "rate_hz: 2000"))
    (warning,) = cycle_warnings(configuration, CycleTime(0.4e-3, 1e-3))
    assert "a cycle takes 0.40 ms" in warning.what
    assert "1250 Hz" in warning.allowed
    assert cycle_warnings(configuration, CycleTime(0.2e-3, 1e-3)) == []


def test_a_cycle_is_measured_as_the_daemon_runs_it() -> None:
    cycle = measure_cycle(load(CONFIG / "tripod-cmm.yaml"))
    assert 0 < cycle.median_s <= cycle.longest_s
    assert math.isfinite(cycle.longest_s)


def test_what_an_effect_in_plain_python_takes_of_a_cycle_is_said(tmp_path: Path) -> None:
    code = tmp_path / "mine.py"
    code.write_text(
        "from dataclasses import replace\n"
        "import numpy as np\n"
        "from compd.model.effects.effect import memoryless_basis\n"
        "from compd.model.library import load_library\n"
        "MINE = replace(load_library()['link_zero'], id='mine',\n"
        "    basis=memoryless_basis(lambda rows, _: np.ones((len(rows), rows.links, 1)) * np.eye(rows.links)))\n"
    )
    code.chmod(0o644)
    model = file_with(tmp_path / "model.yaml", f"{code}:MINE", "backlash")
    configuration = changed(
        tmp_path, ("directory: /var/lib/compd ", f"model_file: {model}\n  directory: /var/lib/compd ")
    )
    times_s = python_effect_times(configuration)
    assert list(times_s) == ["mine"]
    assert times_s["mine"] > 0
