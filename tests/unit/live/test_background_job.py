"""Work beside the publisher: one piece at a time, and free again as soon as the answer goes out."""

from __future__ import annotations

import threading

import pytest

from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.zero_capture import BackgroundJob
from compd.live.system import THIS_COMPUTER
from tests.support.patience import PATIENCE_S


def test_a_second_request_is_refused_while_the_first_is_worked_on():
    job = BackgroundJob("test", "one thing at a time", THIS_COMPUTER)
    finish = threading.Event()
    answers = []

    def work():
        assert finish.wait(PATIENCE_S)
        return b"done"

    job.start(work, answers.append)
    with pytest.raises(ProtocolError, match="one thing at a time") as caught:
        job.start(work, answers.append)
    assert caught.value.code is ErrorCode.BUSY
    finish.set()
    job.join()
    assert answers == [b"done"]


def test_whoever_has_the_answer_may_ask_for_the_next_at_once():
    job = BackgroundJob("test", "busy", THIS_COMPUTER)
    answers = []
    finished = threading.Event()

    def last(answer):
        answers.append(answer)
        finished.set()

    def ask_again(answer):
        answers.append(answer)
        job.start(lambda: b"second", last)

    job.start(lambda: b"first", ask_again)
    assert finished.wait(PATIENCE_S)
    job.join()
    assert answers == [b"first", b"second"]
