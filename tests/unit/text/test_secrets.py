"""Texts without secrets, for messages and logs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.errors import Problem
from compd.text.secrets import HIDDEN, hide_secrets, holds_secret, without_secrets, without_users

SECRET = "Zq7vK2xW9pLm4TnB"


@pytest.mark.parametrize(
    "text",
    [
        f"GET /?token={SECRET} HTTP/1.1",
        f"http://10.0.0.5:7760/recordings?x=1&token={SECRET}&y=2",
        f'{{"class": "AUTH", "token": "{SECRET}"}}',
        f"{{'password': '{SECRET}'}}",
        f"password: {SECRET}",
        f"MQTT_PASSWORD={SECRET}",
        f"connecting to mqtt://anna:{SECRET}@10.0.0.9:1883",
        f"opc.tcp://{SECRET}@plc:4840/x",
    ],
)
def test_a_secret_is_taken_out(text: str) -> None:
    assert SECRET not in without_secrets(text)
    assert HIDDEN in without_secrets(text)


@pytest.mark.parametrize(
    "text",
    [
        "sockets.tcp.token_file /etc/compd/token: cannot be read: Permission denied",
        "machine.yaml:12 lines.plc.password_file: must be an absolute path",
        "the first line must be AUTH with the token",
        "opc.tcp://plc:4840/x has no node ns=2;s=a@b",
        "`user` and `password_file` are not what the server knows",
    ],
)
def test_other_words_stay(text: str) -> None:
    assert without_secrets(text) == text


@pytest.mark.parametrize("key", ["password", "password_file", "tcp_token", "Authorization_token", "private_key"])
def test_what_stands_under_a_key_may_be_a_secret(key: str) -> None:
    assert holds_secret(["lines", 3, key, "x"])
    assert not holds_secret(["lines", 3, "host"])


@given(
    st.text(st.characters(exclude_characters="/?#'\" \t\n\r\f\v\x1c\x1d\x1e\x1f\x85\xa0@", codec="ascii"), min_size=1)
)
def test_no_user_of_a_url_is_in_a_problem(user: str) -> None:
    text = f"mqtt://{user}:{SECRET}@host:1883/x"
    problem = Problem(text, f"{text} is not there", value=text)
    assert SECRET not in str(problem)
    assert without_users(text) == f"mqtt://{HIDDEN}@host:1883/x"


def test_an_event_is_logged_without_secrets() -> None:
    event = {"event": "refused", "token": SECRET, "reason": f"GET /?token={SECRET}", "exception": f"password={SECRET}"}
    assert SECRET not in str(hide_secrets(None, "info", dict(event)))
