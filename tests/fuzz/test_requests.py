"""What clients send: an answer, an error of the protocol, or silence where it is documented; never an exception."""

from __future__ import annotations

import json
import math
import select
import socket
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.errors import StateError
from compd.live.loop import Commands
from compd.live.service import Errands, Messages, RequestContext, Requests, TargetKeys
from compd.live.service.client_session import ClientSession
from compd.live.service.descriptor_bin import DescriptorBin
from compd.live.service.messages import MAX_NUMBER, ErrorCode, ProtocolError
from compd.live.service.requests import REQUESTS, SENT_MESSAGES
from compd.live.system import THIS_COMPUTER
from tests.fuzz.bounds import examples

# Answered by the next setpoint, or later.
SILENT = {"TARGET", "ZERO", "MODEL", "ACCEPT"}
KEYS = sorted({key for kind in REQUESTS.values() for key in kind.model_fields})
NUMBERS = st.one_of(st.floats(), st.integers(), st.sampled_from([0, -0.0, 1e9, -1e9, 1e308, 2**70, math.pi]))
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=8) | st.sampled_from(["/a", "all", "readings", "setpoints"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)
VECTORS = st.lists(NUMBERS, min_size=3, max_size=3)
MESSAGES = st.builds(
    lambda name, keys: {**keys, "class": name},
    st.sampled_from(sorted(REQUESTS)) | st.text(max_size=8) | VALUES,
    st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=6), VECTORS | VALUES, max_size=4),
)
LINES = st.one_of(
    MESSAGES.map(lambda message: json.dumps(message).encode()),
    MESSAGES.map(lambda message: json.dumps(message, ensure_ascii=False).encode("utf-8", "surrogatepass")),
    st.tuples(MESSAGES, st.integers(0, 200)).map(lambda cut: json.dumps(cut[0]).encode()[: cut[1]]),
    VALUES.map(lambda value: json.dumps(value).encode()),
    st.binary(max_size=60),
    st.sampled_from(
        [b"[" * 4000, b'{"class":' * 700, b"\xef\xbb\xbf{}", b"NaN", b"-", b"1" * 4000, b'{"class":"\\ud800"}']
    ),
)


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    one, other = socket.socketpair()
    yield one, other
    one.close()
    other.close()


def requests(tip: str, rotation: bool) -> Requests:
    commands = Commands(StateError.of("zero", "none"))
    return Requests(
        RequestContext(
            clock=THIS_COMPUTER,
            messages=Messages(
                version={
                    "class": "VERSION",
                    "protocol": 1,
                    "release": "1",
                    "machine": "test",
                    "config_hash": "00",
                    "links": 3,
                },
                machine={"class": "MACHINE"},
                status=lambda: {"class": "STATUS"},
                budget=lambda: {"class": "BUDGET"},
            ),
            errands=Errands(take_zero=lambda *_: None, switch_model=lambda *_: None),
            commands=commands,
            target_keys=TargetKeys(tip, rotation),  # type: ignore[arg-type]
        )
    )


def answer_or_error(asked: Requests, client: ClientSession, data: bytes) -> bytes:
    """What the client gets, as the publisher sends it."""
    try:
        return asked.answer(client, data, lambda line: None)
    except ProtocolError as error:
        return error.to_json()


@pytest.mark.long
@pytest.mark.sample
@given(
    lines=st.lists(LINES, min_size=1, max_size=6),
    local=st.booleans(),
    tip=st.sampled_from(["tip_B0_mm", "tip_P_mm"]),
    rotation=st.booleans(),
)
@examples(500)
def test_every_line_has_an_answer_an_error_or_a_documented_silence(
    ends: tuple[socket.socket, socket.socket], lines: list[bytes], local: bool, tip: str, rotation: bool
) -> None:
    asked = requests(tip, rotation)
    client = ClientSession(ends[0], "somebody", local, DescriptorBin(THIS_COMPUTER))
    for data in lines:
        answer = answer_or_error(asked, client, data)
        if not answer:
            assert json.loads(data)["class"] in SILENT
            continue
        message = json.loads(answer)
        assert answer.endswith(b"\n")
        assert message["class"] in SENT_MESSAGES
        if message["class"] == "ERROR":
            assert message["code"] in set(ErrorCode)
            assert message["text"]
            assert len(answer) < 2000
        target = asked.context.commands.target
        if target is not None:
            assert all(abs(number) <= MAX_NUMBER for number in target.tip_mm)
            assert asked.context.controller is client


@pytest.mark.long
@given(pieces=st.lists(st.binary(max_size=3000) | LINES | st.just(b"\n"), max_size=12))
@examples(150)
def test_any_stream_of_bytes_is_lines_and_errors(pieces: list[bytes]) -> None:
    """However the bytes arrive; what is too long is skipped up to its end, and the next line is read."""
    one, other = socket.socketpair()
    with one, other:
        client = ClientSession(one, "somebody", local=True, unwanted=DescriptorBin(THIS_COMPUTER))
        received: list[bytes | ProtocolError] = []
        for piece in [*pieces, b'\n{"class":"VERSION"}\n']:
            other.sendall(piece)
            while select.select([one], [], [], 0)[0]:
                client.receive(0.0)
                while client.has_lines:
                    received.append(client.next_line())
        assert client.open
        assert received[-1] == b'{"class":"VERSION"}'
        assert all(len(line) <= 4096 and b"\n" not in line for line in received if isinstance(line, bytes))
