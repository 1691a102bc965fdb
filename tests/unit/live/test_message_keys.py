"""Every message that the daemon sends has the keys that its model describes, and no others."""

from __future__ import annotations

import json

import pytest
from pydantic import ValidationError

from compd.live.machine.model_loader import ModelLoader, Models
from compd.live.service.message_keys.message import Keys
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.requests import SENT_MESSAGES
from tests.support.live_machine import machine
from tests.support.live_models import file_with
from tests.support.recorded_run import Run
from tests.unit.live.test_daemon import configuration, running, still

__all__ = ["still"]


def checked(line: bytes) -> dict:
    """The message in a line, held to its model."""
    message = json.loads(line)
    name = message.pop("class")
    SENT_MESSAGES[name].model_validate_json(json.dumps(message))
    return message


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


@pytest.mark.parametrize("code", list(ErrorCode))
def test_errors(code):
    assert checked(ProtocolError(code, "why").to_json()) == {"code": code, "text": "why"}


def test_a_key_that_is_not_described_is_refused():
    with pytest.raises(ValidationError, match="surplus"):
        sent({"class": "RELEASE", "surplus": 1})


def kinds(kind: type[Keys]) -> set[type[Keys]]:
    return {kind}.union(*(kinds(derived) for derived in kind.__subclasses__()))


def test_every_message_and_part_is_described():
    assert all(kind.__doc__ for kind in kinds(Keys))


def test_no_message_of_the_protocol_is_lost():
    kept = {"WATCH", "RELEASE", "STATUS", "VERSION", "ZERO", "MODEL", "ERROR", "SETPOINT", "READINGS"}
    kept |= {"MACHINE", "BUDGET"}
    assert kept <= set(SENT_MESSAGES)
