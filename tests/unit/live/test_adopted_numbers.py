"""What the daemon refuses of a model file, what it warns of, and where an effect stays at the edge of its range."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from compd.errors import StateError
from compd.live.record.replay import RecordedCycles, replay_cycles
from compd.model_file import ModelFile
from compd.setpoint_states import State
from tests.support.live_machine import machine
from tests.support.live_models import file_with
from tests.support.measured import hidden
from tests.support.recorded_run import Run
from tests.support.thermometers import PPM_PER_K, warm_machine

MACHINES = [("tripod-cmm.yaml", 3), ("hexapod.yaml", 6)]


def expansion(path, name, links, ppm_per_K=11.5, std=0.1, **parts):
    """A model file with one effect, as `compd model add` writes it."""
    file = ModelFile(
        name.removesuffix(".yaml"),
        links,
        ("link_expansion",),
        (hidden("link_expansion", ppm_per_K),),
        np.array([[std**2]]),
        fitted_range={f"temperature_link_{i + 1}_degC": (19.0, 25.0) for i in range(links)},
    )
    replace(file, **parts).write(path)
    return path


@pytest.mark.parametrize(("name", "links"), MACHINES)
@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        (
            {"ppm_per_K": 745.0},
            "a: is not plausible(.|\n)*745 ppm/K(.|\n)*allowed: 0 to 23 ppm/K(.|\n)*`plausible: {a:",
        ),
        ({"ppm_per_K": -23.0}, "value: -23 ppm/K"),
        ({"ppm_per_K": 11500.0}, "value: 11500 ppm/K"),
        ({"std": 1e150}, "standard error 1e.150"),
        ({"fitted_range": {"temperature_link_1_degC": (19.0, 327.67)}}, "was not plausible in the recording"),
    ],
)
def test_what_is_not_plausible_is_refused(tmp_path, name, links, numbers, said):
    live = machine(name)
    with pytest.raises(StateError, match=said):
        live.loader.read(expansion(tmp_path / "m.yaml", name, links, **numbers))
    assert live.loader.read(expansion(tmp_path / "m.yaml", name, links)).warnings == ()


@pytest.mark.parametrize("determined", [True, False])
def test_an_effect_is_refused_where_none_of_its_numbers_is_determined(tmp_path, determined):
    """What one number leaves open is in the bound; diagnosis names such effects, too."""
    effect, path = hidden("tool_offset", 0.0, 0.0, 0.0), tmp_path / "m.yaml"
    stds = np.array([1e-6 if determined else 1e6, 1e6, 1e6])
    ModelFile("tripod-cmm", 3, ("tool_offset",), (effect,), np.diag(stds**2)).write(path)
    live = machine()
    if determined:
        assert live.loader.read(path).machine.effects
        return
    with pytest.raises(StateError, match="is not plausible"):
        live.loader.read(path)


def test_a_person_may_mean_it(tmp_path):
    file = expansion(tmp_path / "m.yaml", "tripod-cmm.yaml", 3, ppm_per_K=24.0)
    live = machine()
    with pytest.raises(StateError, match="is not plausible"):
        live.loader.read(file)
    data = yaml.safe_load(file.read_text())
    data["effects"][0]["plausible"] = {"a": [0, 30]}
    del data["checksum"]
    file.write_text(yaml.safe_dump(data))
    model = live.loader.read(file)
    assert model.summary["warnings"] == [
        "has no checksum: what was changed in it after it was written cannot be seen: `compd model fit` writes one"
    ]


@pytest.mark.parametrize("name", [name for name, _ in MACHINES])
def test_beyond_its_range_an_effect_stays_at_the_edge_and_says_so(tmp_path, name):
    fitted = {f"temperature_link_{i + 1}_degC": (19.0, 25.0) for i in range(6)}
    live = warm_machine(name, tmp_path, degC=24.9, fitted_range=fitted)
    for channel in live.cabinet.shows:
        live.cabinet.noise_K[channel] = 0.0
    live.run(0.5)
    inside = live.step()
    assert (inside.state, inside.reason) == (State.OK, "")
    start_s = live.now_s
    for channel in live.cabinet.shows:
        live.cabinet.shows[channel] = lambda time_s: 24.9 + 0.15 * (time_s - start_s)
    outside = live.run(8.0)[-1]
    assert outside.state is State.CLAMPED
    assert "effects stay at the edge of their range: temperature_link_1_degC is 26" in outside.reason
    assert "fitted from 19 to 25" in outside.reason
    # 0.1 K to the edge, of 600 mm at most: not 1.2 K
    asked_um = np.abs(outside.values.correction_mm - inside.values.correction_mm).max() * 1e3
    assert asked_um == pytest.approx(PPM_PER_K * 1e-6 * 500 * 0.1 * 1e3, rel=0.5)


def test_a_recording_with_what_was_not_refused_then_is_replayed(tmp_path):
    live = machine()
    path = file_with(tmp_path / "model.yaml", "link_zero")
    data = yaml.safe_load(path.read_text())
    del data["effects"][0]["plausible"], data["checksum"]
    data["format"] = 2
    for entry in data["effects"][0]["parameters"]:
        entry["value"] = 4000.0
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(StateError, match="is not plausible"):
        live.loader.read(path)
    run = Run(live, seed=3)
    with run.recorder(tmp_path / "run") as recorder:
        for line, message, _ in run.quiet(5):
            recorder.put(line, message)
    replayed = list(replay_cycles(live.configuration, RecordedCycles(tmp_path / "run"), [path]))
    assert len(replayed) == 5
