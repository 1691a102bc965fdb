"""Gauges that count after a gap: the daemon is started anew, the acquisition is replaced, ports are exchanged."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from compd.configuration import Configuration, load
from compd.gauge import Quality, Reading, good
from compd.live.acquisition.gauge_trust import GaugeTrust
from compd.live.acquisition.possible_motion import GaugeSample
from compd.live.machine.wiring import MachineWires
from compd.live.memory.latest import Latest
from compd.live.service.last_readings import LastReadings
from compd.live.system import serial_names as port_names
from compd.live.system.serial_names import changed_ports
from compd.live.system.serial_names import port_names as ports_of
from compd.live.wired_trust import wired_memory, wired_trust
from tests.support.hand_clock import HandClock
from tests.support.paths import CONFIG

POLL_S = 0.02
REPLY_S = 0.002
SHIPPED = ["tripod-cmm.yaml", "hexapod.yaml"]


class Shop:
    """The length gauges of a shipped machine at rest, each at another value."""

    def __init__(self, name: str, directory: Path) -> None:
        self.configuration: Configuration = load(CONFIG / name)
        gauges = self.configuration.gauge_objects()
        channels = [f"{gauge}.{c.name}" for gauge, driver in gauges.items() for c in driver.channels]
        self.wires = MachineWires(self.configuration, Latest(channels))
        self.shows_mm = {channel: 7.0 + 0.3 * k for k, channel in enumerate(self.wires.length_channels)}
        self.directory = directory
        self.clock = HandClock()
        self.read: dict[str, Reading] = {}
        self._begin()
        self.poll(10)
        assert not self.not_believed

    def _begin(self) -> None:
        """As the daemon does at its start."""
        self.memory = wired_memory(self.configuration, self.wires)
        self.ports = ports_of(self.configuration)
        self._last = LastReadings(self.directory, self.configuration.zero_hash, self.memory, self.clock, self.ports)
        self._last.recall()
        self.replace_acquisition()

    def replace_acquisition(self, gone_s: float = 0.0) -> None:
        self.clock.now_s += gone_s
        judges = wired_trust(self.configuration, self.wires, self.memory)
        self.trust = {channel: judges[channel] for channel in self.shows_mm}

    def restart(self, gone_s: float) -> None:
        self._last._write_if_changed()
        self.clock.now_s += gone_s
        self._begin()

    def poll(self, rounds: int = 150) -> None:
        for _ in range(rounds):
            for channel, trust in self.trust.items():
                first, reading = None, self._ask(channel)
                if trust.surprises(GaugeSample(reading.value, reading.time_s, 1e-3)):
                    first, reading = reading, self._ask(channel)
                self.read[channel] = trust.judge(reading, 1e-3, first)
            self.clock.now_s += POLL_S

    def _ask(self, channel: str) -> Reading:
        self.clock.now_s += REPLY_S
        return good(self.shows_mm[channel], self.clock.now_s - REPLY_S)

    @property
    def not_believed(self) -> list[str]:
        return [channel for channel, reading in self.read.items() if not reading.ok]

    def accept(self) -> None:
        self.memory.accept("all")
        self.poll(5)


@pytest.fixture(params=SHIPPED)
def shop(request, tmp_path):
    return Shop(request.param, tmp_path)


GAPS: dict[str, Callable[[Shop], None]] = {
    "the daemon is started anew": lambda shop: shop.restart(1.0),
    "the acquisition is replaced": lambda shop: shop.replace_acquisition(0.3),
    "the acquisition hung and is replaced": lambda shop: shop.replace_acquisition(3.0),
}
# What the gauge that measures this shows then, from what it had shown, mm.
FAULTS: dict[str, tuple[str, Callable[[float], float]]] = {
    "its power was off": ("scale 1", lambda mm: mm - 5.0),
    "in inches": ("scale 1", lambda mm: mm / 25.4),
    "ten signal periods": ("scale 1", lambda mm: mm - 0.2),
    "a joint": ("joint 1", lambda mm: mm + 0.030),
    "the frame": ("frame u1", lambda mm: mm + 0.050),
}


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("fault", FAULTS)
def test_after_a_gap_a_gauge_that_shows_another_value_waits_for_a_person(shop, gap, fault):
    meaning, shows = FAULTS[fault]
    channel = next(wire.channel for wire in shop.wires.length_wires if wire.meaning == meaning)
    shop.shows_mm[channel] = shows(shop.shows_mm[channel])
    GAPS[gap](shop)
    shop.poll(1)
    assert not shop.read[channel].ok, "not for one poll"
    shop.poll()
    assert shop.not_believed == [channel]
    assert shop.read[channel].quality is Quality.DISTRUSTED
    shop.accept()
    assert not shop.not_believed


@pytest.mark.parametrize("gap", GAPS)
def test_after_a_gap_gauges_that_show_what_they_showed_need_nobody(shop, gap):
    for _ in range(3):
        GAPS[gap](shop)
        shop.poll(5)
        assert not shop.not_believed


def test_after_a_start_the_second_round_tells_how_everything_moves(shop):
    shop.restart(1.0)
    shop.poll(2)
    assert not shop.not_believed
    unknown = [channel for channel, reading in shop.read.items() if math.isnan(reading.motion.u_mm_per_s)]
    assert not unknown, "each was asked twice: its two answers are two samples"


def test_the_channels_of_the_gauge_that_is_back_last_are_believed_at_once(shop):
    shop.restart(1.0)
    gauges: dict[str, list[str]] = {}
    for channel in shop.trust:
        gauges.setdefault(channel.split(".")[0], []).append(channel)
    for channels in gauges.values():
        trust = GaugeTrust([shop.trust[channel] for channel in channels], shop.clock)
        readings = trust.read(lambda channels=channels: [shop._ask(channel) for channel in channels])
        judged = trust.judge(readings, shop.clock.now_s)
    assert len(judged) > 1
    assert all(reading.ok for reading in judged)


def with_ports_exchanged(configuration: Configuration) -> Configuration:
    """Of the lines of scale 1 and scale 2."""
    one, two = (configuration.gauges[w.gauge.split(".")[0]].line for w in configuration.wiring.scale[:2])
    lines = dict(configuration.lines)
    for line, other in ((one, two), (two, one)):
        address = {
            key: getattr(configuration.lines[other], key)
            for key in ("host", "port")
            if hasattr(configuration.lines[other], key)
        }
        lines[line] = lines[line].model_copy(update=address)
    return replace(configuration, lines=lines)


@pytest.mark.parametrize("reloaded", [True, False])
def test_gauges_whose_ports_were_exchanged_wait_for_a_person_even_where_they_show_the_same(tmp_path, reloaded):
    shop = Shop("tripod-cmm.yaml", tmp_path)
    before = shop.ports
    scales = [wire.channel for wire in shop.wires.length_wires[:2]]
    shop.shows_mm[scales[0]] = shop.shows_mm[scales[1]]
    shop.accept()
    shop.poll()
    shop.configuration = with_ports_exchanged(shop.configuration)
    if reloaded:
        shop.memory.distrust_ports(changed_ports(before, ports_of(shop.configuration)))
        shop.replace_acquisition(1.0)
    else:
        shop.restart(1.0)
    shop.poll()
    assert shop.not_believed == scales
    assert "is at /dev/serial/by-id/usb-scale-2" in shop.read[scales[0]].detail
    shop.accept()
    assert not shop.not_believed


def test_a_port_that_the_kernel_has_counted_has_the_name_of_its_adapter(monkeypatch):
    configuration = load(CONFIG / "tripod-cmm.yaml")
    counted = configuration.lines["scale_1"].model_copy(update={"port": "/dev/ttyUSB7"})
    configuration = replace(configuration, lines={**configuration.lines, "scale_1": counted})
    monkeypatch.setattr(port_names, "serial_ports", list)
    assert "scale_1" not in ports_of(configuration), "not there now: nothing is compared"
    name = "/dev/serial/by-id/usb-FTDI_A1"
    adapter = type("Port", (), {"device": "/dev/ttyUSB7", "path": name})()
    monkeypatch.setattr(port_names, "serial_ports", lambda: [adapter])
    assert ports_of(configuration)["scale_1"] == name
    assert ports_of(configuration)["cabinet"] == "192.168.10.20:502:1"


@pytest.mark.parametrize("shows_mm", [0.0, 5.0])
def test_all_are_asked_for_after_the_computer_was_off_and_not_after_a_restart(shop, monkeypatch, shows_mm):
    """Whether the machine was moved meanwhile no display says that may have lost its power."""
    scales = [wire.channel for wire in shop.wires.scale.wires]
    shop.shows_mm |= dict.fromkeys(shop.shows_mm, shows_mm)
    shop.accept()
    shop.restart(1.0)
    shop.poll()
    assert not shop.not_believed
    shop._last._write_if_changed()
    monkeypatch.setattr(shop.clock, "boot_id", lambda: "another one")
    shop.restart(1.0)
    shop.poll()
    assert set(scales) <= set(shop.not_believed)
    shop.accept()
    assert not shop.not_believed
