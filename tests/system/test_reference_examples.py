"""The examples in the reference of the protocol come from a daemon on the wires of the simulated tripod."""

from __future__ import annotations

import pytest

from compd.live.service.requests import REQUESTS, SENT_MESSAGES
from docs.generate.live_examples import exchanges


@pytest.mark.long
@pytest.mark.sample
def test_every_message_has_an_example_of_its_own_keys() -> None:
    examples = exchanges()
    assert {*REQUESTS, *SENT_MESSAGES} <= examples.keys()
    for name, kind in REQUESTS.items():
        sent = dict(examples[name].sent or {})
        assert sent.pop("class") == name
        kind.model_validate(sent)
    for name, message in SENT_MESSAGES.items():
        received = next(dict(answer) for answer in examples[name].received if answer["class"] == name)
        del received["class"]
        message.model_validate(received, strict=False)
    assert examples["SETPOINT"].received[0]["valid"] is True
    assert examples["TARGET"].received[0]["mode"] == "machine_tool"
