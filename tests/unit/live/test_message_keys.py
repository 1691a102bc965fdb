"""Every message that the daemon sends has the keys that its model describes, and no others."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from pydantic import ValidationError

from compd.configuration import load
from compd.live.machine.model_loader import ModelLoader, Models
from compd.live.service.message_keys.message import ErrorKeys, Keys
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.requests import SENT_MESSAGES
from compd.setpoint_states import State
from tests.support.built_machines import drawing
from tests.support.live_machine import Machine, machine
from tests.support.live_models import file_with
from tests.support.recorded_run import Run
from tests.unit.live.test_daemon import configuration, first, running, still

__all__ = ["still"]


def checked(line: bytes) -> dict:
    """The message in a line, held to its model; null is nowhere in it."""
    message = json.loads(line)
    assert list(nulls(message)) == []
    name = message.pop("class")
    SENT_MESSAGES[name].model_validate_json(json.dumps(message))
    return message


def nulls(value: object, where: str = "") -> Iterator[str]:
    """Where null is in a message."""
    if value is None:
        yield where
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in parts:
        yield from nulls(part, f"{where}.{key}")


def sent(message: dict) -> dict:
    return checked(json.dumps(message).encode())


@pytest.mark.parametrize("name", ["tripod-cmm", "hexapod"])
def test_setpoints_and_readings_of_an_eventful_run(name, tmp_path):
    live = machine(f"{name}.yaml")
    loader = ModelLoader(live.model, live.configuration.machine, live.configuration.geometry_hash, live.wires)
    shadow = file_with(tmp_path / "m.yaml", "link_zero", name=name, links=live.model.links)
    run = Run(live)
    states, reading_keys = set(), set()
    for cycle, (line, _, setpoint) in enumerate(run.eventful(400)):
        if cycle == 300:
            live.commands.models = Models(loader.read(shadow), loader.read(shadow))
        checked(setpoint.to_json())
        message = checked(line)
        checked(json.dumps(message["setpoint"]).encode())
        states.add(setpoint.state)
        reading_keys |= message.keys()
    assert len(states) > 3, "the run is eventful"
    assert {"target", "zero", "model", "shadow", "model_files", "carried", "approach"} <= reading_keys


@pytest.mark.usefixtures("still")
def test_answers_of_a_running_daemon(tmp_path):
    file = file_with(tmp_path / "m.yaml", "link_zero")
    with running(configuration(tmp_path, udp_port=9)) as (_, client):
        sent(client.version)
        readings = client.readings(rate_hz=100)
        columns = sent(next(readings)[1])["columns"]
        assert ["sign" in column for column in columns[20:22]] == [True, False], "nine frame distances, then the rest"
        line, message = next(readings)
        checked(line)
        assert message["no_zero"]["next_step"]
        client._ask({"class": "WATCH", "rate_hz": 0}, "WATCH")
        sent(client.zero())
        sent(client.poll("scale_1"))
        assert sent(client.model())["applied"] == {"effects": []}
        assert sent(client.model(str(file), shadow=True))["shadow"]["file"] == str(file)
        assert sent(client.machine())["wiring"][0]["kind"] == "scale"
        assert sent(client.budget())["state"]
        status = client.status()
        assert [connected["controller"] for connected in status["publisher"]["connected"]] == [False]
        assert status["model"]["shadow"]["effects"] == ["link_zero"]
        status["lines"] = {}  # no real ones here: test_acquisition holds those to their model
        sent(status)


@pytest.mark.usefixtures("still")
@pytest.mark.parametrize("kind", ["3-prs", "linear-delta", "6-ups"])
def test_a_client_of_a_machine_without_frame_gauges_reads_no_null(kind, tmp_path):
    """The bound of the tip's error is unknown there."""
    with running(configuration(tmp_path, drawing(kind, tmp_path))) as (_, client):
        for message in (client.version, client.zero(), client.machine(), client.budget(), client.model()):
            sent(message)
        setpoint = sent(first(client.watch(), "ok"))
        assert "u_tip_um" not in setpoint
        assert "correction_mm" in setpoint
        sent(client.status() | {"lines": {}})
    with running(configuration(tmp_path, drawing(kind, tmp_path))) as (_, client):
        readings = client.readings(rate_hz=100)
        sent(next(readings)[1])
        assert "u_tip_um" not in checked(next(readings)[0])["setpoint"]


@pytest.mark.parametrize("kind", ["3-rps", "rotary-delta"])
def test_setpoints_and_readings_of_a_machine_without_frame_gauges(kind, tmp_path):
    run = Run(Machine(load(drawing(kind, tmp_path))))
    states = set()
    for line, _, setpoint in run.eventful(200):
        checked(setpoint.to_json())
        checked(line)
        states.add(setpoint.state)
    assert {State.OK} < states, "the run is eventful"


@pytest.mark.parametrize("code", list(ErrorCode))
def test_errors(code):
    assert checked(ProtocolError(code, "why").to_json()) == {"code": code, "text": "why"}


def test_a_key_that_is_not_described_is_refused():
    with pytest.raises(ValidationError, match="surplus"):
        sent({"class": "RELEASE", "surplus": 1})


def test_a_message_is_made_by_its_model_and_of_no_other_keys():
    assert ErrorKeys.line(code="idle", text="why") == ProtocolError(ErrorCode.IDLE, "why").to_json()
    assert SENT_MESSAGES["ZERO"].message(taken_at="now", without=None, changed_mm={"a": 0.0}) == {
        "class": "ZERO",
        "taken_at": "now",
        "changed_mm": {"a": 0.0},
    }
    with pytest.raises(TypeError, match="ZERO has no token"):
        SENT_MESSAGES["ZERO"].line(token="x")


def kinds(kind: type[Keys]) -> set[type[Keys]]:
    return {kind}.union(*(kinds(derived) for derived in kind.__subclasses__()))


def test_every_message_and_part_is_described():
    assert all(kind.__doc__ for kind in kinds(Keys))


def test_no_message_of_the_protocol_is_lost():
    kept = {"WATCH", "RELEASE", "STATUS", "VERSION", "ZERO", "MODEL", "ERROR", "SETPOINT", "READINGS"}
    kept |= {"MACHINE", "BUDGET"}
    assert kept <= set(SENT_MESSAGES)
