"""The whole simulated machine on real ptys and sockets, read by the product's own drivers."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from compd.clock import MonotonicClock
from compd.configuration import Configuration, load
from compd.errors import PluginError
from compd.gauge import LineFault, Quality, Reading
from compd.lines import open_line
from compd.simulation.causes.hidden_cause import draw_hidden
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.world import World
from compd.simulation.wires.server import STEP_S, Simulation
from tests.support.patience import PATIENCE_S
from tests.support.simulated import HEXAPOD, TRIPOD, ask, run_directory

HEAT = {"drives_W": [0.0] * 3, "ring_W": 0.0, "cabinet_W": [0.0] * 3, "platform_W": 0.0, "tool_W": 0.0, "lamps_W": 0.0}


class TurnedClock:
    """A clock that stands until `turn` moves it on; `turn` returns when whoever waits has gone on."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._now_s = 0.0
        self._waits = 0

    def monotonic(self) -> float:
        return self._now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        with self._changed:
            self._waits += 1
            self._changed.notify_all()
            end_s = self._now_s + timeout_s
            while self._now_s < end_s and not event.is_set():
                self._changed.wait(0.01)  # an event cannot notify a condition
        return event.is_set()

    def turn(self, time_s: float) -> None:
        """Only with somebody waiting, and for at least what they wait for."""
        with self._changed:
            assert self._changed.wait_for(lambda: self._waits > 0, PATIENCE_S)
            waits = self._waits
            self._now_s += time_s
            self._changed.notify_all()
            assert self._changed.wait_for(lambda: self._waits > waits, PATIENCE_S)


class Running:
    """A started simulation, the clock that turns it and a connection to its control socket."""

    def __init__(self, path: Path, directory: Path) -> None:
        self.configuration = load(path)
        world = World(self.configuration.geometry, self.configuration.wiring, 1, 100.0, zero_hold_s=1000.0)
        self.clock = TurnedClock()
        self.simulation = Simulation(self.configuration, world, directory, self.clock)
        self.daemon: Configuration = self.simulation.start()
        self.control = socket.socket(socket.AF_UNIX)
        self.control.settimeout(PATIENCE_S)
        self.control.connect(str(directory / "control.sock"))

    def stop(self) -> None:
        self.control.close()
        self.simulation.stop()

    def read(self, gauge: str, timeout_s: float = PATIENCE_S) -> dict[str, Reading]:
        """By the product's own driver, over the port that the daemon's configuration names."""
        settings = self.daemon.lines[self.daemon.gauges[gauge].line].model_copy(update={"timeout_s": timeout_s})
        line = open_line(settings, MonotonicClock())
        try:
            driver = self.daemon.gauge_objects()[gauge]
            readings = driver.read(line)
            return {channel.name: reading for channel, reading in zip(driver.channels, readings, strict=True)}
        finally:
            line.close()


@pytest.fixture
def start() -> Iterator[Callable[[Path], Running]]:
    started: list[Running] = []
    with run_directory() as directory:

        def begin(path: Path) -> Running:
            started.append(Running(path, directory))
            return started[-1]

        yield begin
        for running in started:
            running.stop()
        assert list(directory.iterdir()) == [], "nothing is left of it"


@pytest.mark.parametrize("path", [TRIPOD, HEXAPOD], ids=["tripod", "hexapod"])
def test_every_gauge_shows_the_world_through_its_own_protocol(start: Callable[[Path], Running], path: Path) -> None:
    running = start(path)
    links = running.configuration.geometry.links
    assert ask(running.control, {"class": "DRIVE", "scale_mm": [7.0] * links})["moving"]
    running.clock.turn(30.0)
    truth = ask(running.control, {"class": "TRUTH"})
    assert truth["scale_mm"] == [7.0] * links
    assert not truth["moving"]
    assert truth["monotonic_s"] == running.clock.monotonic()
    world, wiring = running.simulation.world, running.configuration.wiring
    read = {gauge: running.read(gauge) for gauge in running.configuration.gauges}
    assert all(reading.ok for channels in read.values() for reading in channels.values())
    wires = [(wire.gauge, f"joint_{k + 1}", 6e-5) for k, wire in enumerate(wiring.joint)]
    wires += [(wire.gauge, f"frame_{wire.distance}", 6e-5) for wire in wiring.frame]
    wires += [(quantity.gauge, quantity.name, 6e-3) for quantity in wiring.quantities]
    assert max(abs(world.sense(name)) for _, name, _ in wires if name.startswith("frame_")) > 1e-3
    for reference, name, step in wires:
        gauge, channel = reference.split(".")
        assert read[gauge][channel].value == pytest.approx(world.sense(name), abs=step)
    for wire in wiring.scale:
        assert read[wire.gauge]["position"].value == pytest.approx(7.0, abs=1e-4)


def test_machine_zero_is_held_until_somebody_drives(start: Callable[[Path], Running]) -> None:
    running = start(TRIPOD)
    running.clock.turn(5.0)
    truth = ask(running.control, {"class": "TRUTH"})
    assert (truth["mode"], truth["zero_hold_s"], truth["weather_time_s"]) == ("zero", 995.0, 0.0)
    assert truth["tip_mm"] == pytest.approx([0.0, 0.0, 190.0], abs=1e-9)
    ask(running.control, {"class": "TOUR"})
    running.clock.turn(2.0)
    truth = ask(running.control, {"class": "TRUTH"})
    assert truth["mode"] == "tour"
    assert truth["weather_time_s"] == pytest.approx(200.0)


def test_a_stream_of_commands_is_followed_and_a_wrong_one_is_refused(start: Callable[[Path], Running]) -> None:
    running = start(TRIPOD)
    commands = [[0.1 * k, 0.05 * k, 0.0, -0.05 * k] for k in range(21)]
    assert ask(running.control, {"class": "FOLLOW", "commands": commands})["mode"] == "following"
    for _ in range(12):
        running.clock.turn(0.5)
    truth = ask(running.control, {"class": "TRUTH"})
    assert truth["scale_mm"] == pytest.approx([1.0, 0.0, -1.0])
    refused = ask(running.control, {"class": "FOLLOW", "commands": [[3.0, 900.0, 0.0, 0.0]]})
    assert refused["code"] == "refused"
    assert ask(running.control, {"class": "FOLLOW", "commands": [3.0]})["code"] == "wrong_value"


def test_a_tracker_shows_the_tip_with_its_noise(start: Callable[[Path], Running]) -> None:
    running = start(TRIPOD)
    ask(running.control, {"class": "DRIVE", "scale_mm": [3.0, -4.0, 5.0]})
    running.clock.turn(10.0)
    true_mm = np.array(ask(running.control, {"class": "TRUTH"})["tip_mm"])
    answers = [ask(running.control, {"class": "MEASURE"}) for _ in range(100)]
    off_um = 1e3 * (np.array([answer["reference_mm"] for answer in answers]) - true_mm)
    assert {answer["class"] for answer in answers} == {"MEASURED"}
    assert {answer["monotonic_s"] for answer in answers} == {running.clock.monotonic()}
    assert np.std(off_um) == pytest.approx(answers[0]["sigma_um"], rel=0.2)
    assert np.abs(off_um.mean(axis=0)).max() < 0.1
    link_um = 1e3 * np.array([answer["link_mm"] for answer in answers])
    assert np.std(link_um, axis=0) == pytest.approx(np.full(3, answers[0]["link_sigma_um"]), rel=0.25)
    # no cause is hidden: the links have changed by what the scales show, but for the joints' and the frame's errors
    assert link_um.mean(axis=0) / 1e3 == pytest.approx([3.0, -4.0, 5.0], abs=0.1)


def test_truth_for_other_scale_values_and_under_load(start: Callable[[Path], Running]) -> None:
    running = start(TRIPOD)
    there = ask(running.control, {"class": "TIP_FOR", "scale_mm": [1.0, 1.0, 1.0]})
    assert there["tip_frame"] == "M"
    assert there["tip_mm"][2] < 189.5
    truth = ask(running.control, {"class": "TRUTH"})
    assert truth["mode"] == "zero"
    ask(running.control, {"class": "LOAD", "force_M_N": [0.0, 0.0, -50.0]})
    ask(running.control, {"class": "DRIVE", "scale_mm": [0.0, 0.0, 0.0]})
    running.clock.turn(STEP_S)
    loaded = ask(running.control, {"class": "TRUTH"})
    assert loaded["tip_mm"][2] < truth["tip_mm"][2] - 1e-4


def test_parts_warm_up_where_heat_is_switched_on(start: Callable[[Path], Running]) -> None:
    running = start(TRIPOD)
    assert ask(running.control, {"class": "HEAT", **HEAT, "drives_W": [3.0, 0.0, 0.0]})["class"] != "ERROR"
    ask(running.control, {"class": "DRIVE", "scale_mm": [0.0, 0.0, 0.0]})
    running.clock.turn(10.0)
    running.clock.turn(10.0)
    link_1, link_2 = (running.simulation.world.sense(f"temperature_link_{i}_degC") for i in (1, 2))
    assert link_1 > link_2 + 1.0


@pytest.mark.parametrize(
    "message",
    [
        {"class": "DRIVE", "scale_mm": [1.0]},
        {"class": "DRIVE", "scale_mm": [900.0, 0.0, 0.0]},
        {"class": "DRIVE", "scale_mm": "home"},
        {"class": "LOAD", "force_M_N": [1.0, 2.0]},
        {"class": "LOAD", "force_M_N": [1.0, 2.0, float("inf")]},
        {"class": "HEAT", "ring_W": 1.0},
        {"class": "HEAT", **HEAT, "drives_W": [1.0]},
        {"class": "HEAT", **HEAT, "cabinet_W": 1.0},
        {"class": "HEAT", **HEAT, "ring_W": -1.0},
        {"class": "HEAT", **HEAT, "lamps_W": float("nan")},
        {"class": "FAULT", "line": "nowhere", "fault": "silent"},
        {"class": "FAULT", "line": ["joints"], "fault": "silent"},
        {"class": "FAULT", "line": "joints", "fault": "bored"},
        {"class": "FAULT", "line": "joints"},
    ],
)
def test_what_cannot_be_done_is_refused(start: Callable[[Path], Running], message: dict[str, object]) -> None:
    running = start(TRIPOD)
    answer = ask(running.control, message)
    assert answer["class"] == "ERROR"
    assert answer["text"]
    assert ask(running.control, {"class": "TRUTH"})["mode"] == "zero"


def test_a_line_breaks_and_mends_on_request(start: Callable[[Path], Running]) -> None:
    running = start(TRIPOD)
    ask(running.control, {"class": "FAULT", "line": "joints", "fault": "silent"})
    with pytest.raises(LineFault) as silent:
        running.read("joints", timeout_s=0.1)
    assert silent.value.quality is Quality.TIMEOUT
    assert all(reading.ok for reading in running.read("frame_u").values())
    ask(running.control, {"class": "FAULT", "line": "joints", "fault": None})
    assert all(reading.ok for reading in running.read("joints").values())


def test_a_driver_without_a_simulated_device_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    configuration = load(TRIPOD)
    world = World(configuration.geometry, configuration.wiring, 1)
    monkeypatch.setattr("compd.simulation.wires.server.SIMULATED_GAUGES", "compd.no_such_group")
    with run_directory() as directory, pytest.raises(PluginError, match=r"gauges\.scale_1\.driver"):
        Simulation(configuration, world, directory, TurnedClock())


@pytest.mark.long
def test_the_command_serves_until_it_is_stopped() -> None:
    with run_directory() as directory:
        command = [sys.executable, "-m", "compd", "sim", "run", str(TRIPOD), "--directory", str(directory)]
        environment = {**os.environ, "COLUMNS": "160"}
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
            assert process.stdout is not None
            printed = ""
            while "Ctrl-C ends" not in printed:
                line = process.stdout.readline()
                assert line, printed
                printed += line
            with socket.socket(socket.AF_UNIX) as control:
                control.connect(str(directory / "control.sock"))
                assert ask(control, {"class": "TRUTH"})["mode"] == "zero"
            process.send_signal(signal.SIGTERM)
            assert process.wait(PATIENCE_S) == 0
        assert f"compd run {directory / TRIPOD.name}" in printed
        assert all(name in printed for name in load(TRIPOD).lines)
        assert list(directory.iterdir()) == []


@pytest.mark.long
@pytest.mark.sample
def test_the_command_hides_a_cause_under_seal() -> None:
    with run_directory() as directory:
        options = ["--directory", str(directory), "--hidden", "3", "--seconds", "0"]
        command = [sys.executable, "-m", "compd", "sim", "run", str(TRIPOD), *options]
        finished = subprocess.run(command, capture_output=True, text=True, check=True)
        answer = json.loads((directory / "hidden.answer.json").read_text(encoding="utf-8"))
        (name,) = answer["effects"]
        assert name == draw_hidden(3, Mechanism(load(TRIPOD).geometry)).id
        assert answer["error_in_floors"][name] > 0.5
        assert name not in finished.stdout


@pytest.mark.long
def test_the_command_hides_a_cause_that_was_stated() -> None:
    with run_directory() as directory:
        options = ["--directory", str(directory), "--effect", "link_expansion=8", "--seconds", "0"]
        command = [sys.executable, "-m", "compd", "sim", "run", str(TRIPOD), *options]
        subprocess.run(command, capture_output=True, text=True, check=True)
        answer = json.loads((directory / "hidden.answer.json").read_text(encoding="utf-8"))
        assert answer["effects"] == {"link_expansion": 8.0}


@pytest.mark.long
def test_the_machines_own_directory_is_refused_and_left_alone() -> None:
    with run_directory() as directory:
        own = directory / TRIPOD.name
        own.write_text(TRIPOD.read_text())
        finished = subprocess.run(
            [sys.executable, "-m", "compd", "sim", "run", str(own), "--directory", str(directory)],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
        assert finished.returncode == 2
        assert "overwrite" in finished.stderr
        assert list(directory.iterdir()) == [own]
        assert own.read_text() == TRIPOD.read_text()
