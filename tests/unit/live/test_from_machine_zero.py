"""The live correction counts from the quantities at machine zero, and what was fitted before that keeps its meaning."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import yaml

from compd.cli.measurements.model.adopt import adopt
from compd.errors import DaemonError
from compd.gauge import Quality
from compd.live import daemon as daemon_module
from compd.live.machine.machine_zero import MachineZero, load_zero
from compd.live.machine.model_loader import Models
from compd.live.service.zero_capture import ZeroCapture
from compd.live.system import THIS_COMPUTER, System
from compd.setpoint_states import State
from tests.support.live_machine import PERIOD_S, Machine, machine
from tests.support.live_models import file_with, warm
from tests.unit.live.test_daemon import StillGauges, configuration, first, running

PPM_PER_K = 11.5
MACHINES = pytest.mark.parametrize(("name", "links"), [("tripod-cmm", 3), ("hexapod", 6)])


class LiveClock(System):
    """Time passes as whoever takes zero waits, and the gauges are read meanwhile."""

    def __init__(self, live: Machine) -> None:
        self.live = live

    def monotonic(self):
        return self.live.now_s

    def wait(self, event, timeout_s):
        for _ in range(round(timeout_s / PERIOD_S)):
            self.live.step()
        return event.is_set()


def take_zero(live: Machine, directory) -> dict:
    """The answer to `compd zero`."""
    answers = []
    live.step()
    capture = ZeroCapture(
        live.wires, live.latest, live.commands, directory, live.configuration.zero_hash, LiveClock(live)
    )
    capture.start(True, answers.append)
    capture._job.join()
    return json.loads(answers[0])


def expansion(live: Machine, tmp_path, name, links) -> Models:
    file = file_with(tmp_path / "m.yaml", "link_expansion", name=name, links=links, link_expansion=PPM_PER_K)
    return Models(live.loader.read(file))


@MACHINES
@pytest.mark.parametrize("degC", [15.0, 20.2, 23.0, 27.0])
def test_nothing_is_corrected_where_machine_zero_was_taken(tmp_path, name, links, degC):
    live = machine(f"{name}.yaml")
    cold = live.latest.put
    warm(live, degC)
    answer = take_zero(live, tmp_path)
    assert answer["class"] == "ZERO"
    assert list(answer["quantities"].values()) == pytest.approx([degC] * len(live.wires.quantity_names))
    live.commands.models = expansion(live, tmp_path, name, links)
    assert live.settle().values.contributions["link_expansion"] == pytest.approx(np.zeros(links), abs=1e-12)
    live.latest.put = cold
    warm(live, degC + 1.0)
    grown = live.settle().values
    assert grown.contributions["link_expansion"] == pytest.approx(-1e-6 * PPM_PER_K * grown.link_length_mm, rel=1e-4)
    assert live.settings.model.zero.link_length_mm == pytest.approx(grown.link_length_mm, abs=0.1)
    again = load_zero(tmp_path, live.configuration.zero_hash, live.wires.length_channels, THIS_COMPUTER)
    assert again == live.commands.zero, "the file has the quantities, too"


@MACHINES
def test_a_model_of_an_old_file_counts_from_20_degC_and_says_so(tmp_path, name, links):
    live = machine(f"{name}.yaml")
    warm(live, 23.0)
    take_zero(live, tmp_path)
    models = expansion(live, tmp_path, name, links)
    assert "from_20_degC" not in models.applied.summary
    content = yaml.safe_load((tmp_path / "m.yaml").read_text())
    assert content["effects"][0].pop("counts_from") == "machine zero"
    del content["checksum"]
    (tmp_path / "old.yaml").write_text(yaml.safe_dump(content | {"format": 2}))
    old = live.loader.read(tmp_path / "old.yaml")
    assert old.summary["from_20_degC"] == ["link_expansion"]
    live.commands.models = Models(old)
    values = live.settle().values
    assert values.contributions["link_expansion"] == pytest.approx(-3e-6 * PPM_PER_K * values.link_length_mm, rel=1e-4)


@MACHINES
def test_a_zero_without_the_quantities_is_no_zero_for_such_a_model(tmp_path, name, links):
    """Not a default in place of what was not measured: a zero of an old release, or taken without a thermometer."""
    live = machine(f"{name}.yaml")
    before = live.commands.zero
    live.commands.zero = MachineZero(before.zero_hash, before.taken_at, before.readings_mm)
    assert live.settle().valid
    live.commands.models = expansion(live, tmp_path, name, links)
    refused = live.step()
    assert (refused.state, refused.valid) == (State.NO_ZERO, False)
    for part in (before.taken_at, "temperature_link_1_degC", "`compd zero`"):
        assert part in refused.reason
    live.commands.models = Models(live.loader.without_effects, live.commands.models.applied)
    beside = live.step()
    assert beside.valid
    assert "machine zero has no temperature_link_1_degC" in beside.shadow.reason
    take_zero(live, tmp_path)
    assert not live.step().shadow.reason


def test_zero_is_taken_without_a_thermometer_that_is_broken_and_says_so(tmp_path):
    live = machine()
    warm(live, 23.0)
    live.faults["cabinet.link_2"] = Quality.SENSOR_FAULT
    answer = take_zero(live, tmp_path)
    assert answer["without"] == ["temperature_link_2_degC"]
    assert set(live.commands.zero.quantities) == set(live.wires.quantity_names) - {"temperature_link_2_degC"}


def test_a_running_daemon_refuses_a_model_that_its_zero_does_not_fit(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(daemon_module, "Acquisition", StillGauges)
    configured = configuration(tmp_path)
    file = file_with(tmp_path / "m.yaml", "link_expansion", link_expansion=PPM_PER_K)
    with running(configured) as (daemon, client):
        client.zero()
        zero = daemon.commands.zero
        daemon.commands.zero = MachineZero(zero.zero_hash, zero.taken_at, zero.readings_mm)
        with pytest.raises(DaemonError, match=r"has no temperature_link_1_degC.*from which effects of the model count"):
            client.model(str(file))
        assert first(client.watch(), "ok")["sources_mm"].keys() == {"joints", "frame"}, "and nothing has changed"
        daemon.commands.zero = zero
        adopt(file, configured.sockets.unix.path)
        assert "20 degC" not in capsys.readouterr().out
        old = tmp_path / "old.yaml"
        text = re.sub("^checksum:.*\n", "", file.read_text(), flags=re.MULTILINE)
        old.write_text(text.replace("counts_from: machine zero", "counts_from: 20 degC"))
        adopt(old, configured.sockets.unix.path)
        assert "from 20 degC and not from machine zero" in capsys.readouterr().out
