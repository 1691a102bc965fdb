"""The whole chain on real wires: simulated gauges on ptys and TCP ports, the daemon, clients; and what breaks."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.client import Client, connect
from compd.demo.machine_zero import wait_for_gauges
from compd.demo.processes import Command, run_commands
from compd.simulation import ControlClient
from tests.support.patience import PATIENCE_S
from tests.support.processes import takes_zero
from tests.support.simulated import TRIPOD, made_patient
from tests.support.watching import until

RATE_HZ = 50.0

Setpoint = dict[str, Any]


@dataclass
class Chain:
    """A running machine and daemon."""

    directory: Path
    machine: ControlClient
    daemon: Client
    setpoints: Iterator[Setpoint]

    def until(self, what: str, holds: Callable[[Setpoint], bool]) -> Setpoint:
        """The first setpoint for which `holds`; fails, with the last one seen, when none comes."""
        end = time.monotonic() + PATIENCE_S
        for setpoint in self.setpoints:
            if holds(setpoint):
                return setpoint
            assert time.monotonic() < end, f"{what}: still {setpoint}"
        raise AssertionError("the daemon went away")

    def accept(self) -> None:
        """A person accepts the gauges that are not believed after a pause of the computer."""
        with connect(self.directory / "compd.sock", PATIENCE_S) as operator:
            if "waits_for_person" in operator.status():
                operator.accept("all")

    def settle(self, target_M_mm: list[float]) -> Setpoint:
        """Send the target, drive to the setpoints until the machine rests there with every gauge read anew."""
        target_B0_mm = [target_M_mm[0], target_M_mm[1], target_M_mm[2] - 700.0]
        self.daemon.target(tip_B0_mm=target_B0_mm)
        at_rest: list[float] = []

        def rests(setpoint: Setpoint) -> bool:
            self.daemon.target(tip_B0_mm=target_B0_mm)  # again: it grows old
            if setpoint["state"] == "fault":  # the machine was moved on in one step: its computer was busy
                self.accept()
            if not setpoint["valid"] or setpoint["mode"] != "machine_tool":
                return False
            truth = self.machine.ask("DRIVE", scale_mm=setpoint["scale_setpoint_mm"])
            if np.abs(np.subtract(truth["scale_mm"], setpoint["scale_setpoint_mm"])).max() > 0.005:
                at_rest.clear()
                return False
            at_rest.append(time.monotonic())
            return setpoint["state"] == "ok" and setpoint["time_s"] - setpoint["age_s"] - at_rest[0] > 0.5

        return self.until("at rest at the target", rests)


@pytest.fixture(autouse=True)
def accepted(chain: Chain) -> None:
    chain.accept()


@pytest.fixture(autouse=True)
def without_a_controller(chain: Chain) -> Iterator[None]:
    """A test that was the controller is not when it ends: its target would grow old in the next one."""
    yield
    if next(chain.setpoints)["mode"] == "machine_tool":
        chain.daemon.release()
        chain.until("without a target", lambda setpoint: setpoint["mode"] == "cmm")


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chain]:
    directory = tmp_path_factory.mktemp("chain")
    patient = tmp_path_factory.mktemp("patient") / TRIPOD.name
    patient.write_text(made_patient(TRIPOD.read_text()))
    simulate = [
        "sim",
        "run",
        str(patient),
        "--directory",
        str(directory),
        "--seed",
        "3",
        "--zero-hold",
        "600",
    ]
    commands = [
        Command(simulate, ready=directory / "control.sock"),
        Command(["run", str(directory / "tripod-cmm.yaml")], ready=directory / "compd.sock"),
    ]
    with (
        run_commands(commands, log=directory / "output.log"),
        ControlClient(directory / "control.sock") as machine,
        connect(directory / "compd.sock", PATIENCE_S) as daemon,
    ):
        chain = Chain(directory, machine, daemon, daemon.watch(RATE_HZ))
        first = chain.until("the first answer", lambda s: s["state"] in {"no_zero", "starting"})
        assert not first["valid"]
        assert "tip_M_mm" not in first, "without machine zero no number may look alive"
        machine.ask("DRIVE", scale_mm=[0.0, 0.0, 0.0])
        chain.until("at zero", lambda _: not machine.ask("TRUTH")["moving"])
        with connect(directory / "compd.sock", PATIENCE_S) as operator:
            wait_for_gauges(operator, chain.setpoints)
            until("machine zero is taken", lambda: takes_zero(operator))
        chain.until("valid after zero", lambda s: s["state"] == "ok")
        yield chain


def test_the_tip_of_a_cmm_is_where_the_truth_says(chain: Chain) -> None:
    setpoint = chain.until("valid and new", lambda s: s["state"] == "ok" and s["age_s"] < 0.5)
    truth = chain.machine.ask("TRUTH")
    assert np.linalg.norm(np.subtract(setpoint["tip_M_mm"], truth["tip_mm"])) < 2e-3
    assert setpoint["valid_until"] > setpoint["time_s"]


def test_the_sources_add_up_to_the_correction(chain: Chain) -> None:
    setpoint = chain.settle([20.0, -30.0, 200.0])
    total = np.sum(list(setpoint["sources_mm"].values()), axis=0)
    np.testing.assert_allclose(total, setpoint["correction_mm"], atol=2e-7)


@pytest.mark.parametrize("target", [[40.0, 30.0, 215.0], [-45.0, -40.0, 215.0]])
def test_driving_to_the_setpoint_brings_the_tip_nearer_than_the_scales_alone(chain: Chain, target: list[float]) -> None:
    setpoint = chain.settle(target)
    scale = np.array(setpoint["scale_setpoint_mm"])
    corrected = chain.machine.ask("TIP_FOR", scale_mm=scale.tolist())["tip_mm"]
    nominal = chain.machine.ask("TIP_FOR", scale_mm=(scale - setpoint["correction_mm"]).tolist())["tip_mm"]
    error, error_nominal = (float(np.linalg.norm(np.subtract(tip, target))) for tip in (corrected, nominal))
    assert error < 2e-3
    assert error < 0.5 * error_nominal


@pytest.mark.parametrize(
    ("line", "fault", "gauge", "qualities"),
    [
        ("joints", "silent", "joints", {"timeout"}),
        ("joints", "garble", "joints", {"mismatch", "incomplete", "crc"}),
        ("frame_u", "garble", "frame_u", {"crc"}),
        ("frame_u", "unplugged", "frame_u", {"line_lost"}),
        ("cabinet", "unplugged", "cabinet", {"line_lost"}),
    ],
)
def test_a_broken_comparator_line_is_held_named_and_comes_back(
    chain: Chain, line: str, fault: str, gauge: str, qualities: set[str]
) -> None:
    chain.until("ok before", lambda s: s["state"] == "ok")
    chain.machine.ask("FAULT", line=line, fault=fault)
    try:
        held = chain.until("held", lambda s: s["state"] == "hold")
        assert gauge in held["reason"]
        assert any(quality in held["reason"] for quality in (*qualities, "stale")), held["reason"]
        assert held["valid"], "hold keeps the last good set for a while"
    finally:
        chain.machine.ask("FAULT", line=line, fault=None)
    chain.until("ok again by itself", lambda s: s["state"] == "ok")


def test_hold_ends_and_the_numbers_go(chain: Chain) -> None:
    chain.machine.ask("FAULT", line="joints", fault="silent")
    try:
        stopped = chain.until("stopped", lambda s: s["state"] == "stop")
        assert not stopped["valid"]
        assert "correction_mm" not in stopped
    finally:
        chain.machine.ask("FAULT", line="joints", fault=None)
    chain.until("ok again", lambda s: s["state"] == "ok")


def test_a_lost_scale_leaves_a_cmm_without_a_tip_and_other_lines_go_on(chain: Chain) -> None:
    with connect(chain.directory / "compd.sock", PATIENCE_S) as observer:
        before = observer.status()
        chain.machine.ask("DRIVE", scale_mm=[3.0, 4.0, 5.0])  # at zero a person would be asked for
        chain.until("at rest", lambda _: not chain.machine.ask("TRUTH")["moving"])
        rests_s = time.monotonic()
        chain.until("all are read at rest", lambda s: s["state"] == "ok" and s["time_s"] - s["age_s"] > rests_s)
        chain.machine.ask("FAULT", line="scale_2", fault="unplugged")
        try:
            lost = chain.until("invalid", lambda s: not s["valid"])
            assert "scale_2" in lost["reason"]
            polled = chain.until(
                "the others go on", lambda _: _polls(observer, "joints") > _polls_in(before, "joints") + 10
            )
            assert not polled["valid"]
        finally:
            chain.machine.ask("FAULT", line="scale_2", fault=None)
        chain.until("ok again", lambda s: s["state"] == "ok")


def _polls(observer: Client, gauge: str) -> int:
    return _polls_in(observer.status(), gauge)


def _polls_in(status: dict[str, Any], gauge: str) -> int:
    return sum(int(line["gauges"][gauge]["polls"]) for line in status["lines"].values() if gauge in line["gauges"])
