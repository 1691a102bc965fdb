"""What becomes of gauges that a person accepts: the answer says of each for how long it is believed, or why not."""

from __future__ import annotations

import json
import queue

import pytest

from compd.live.memory.trust_memory import Doubt, TrustMemory
from compd.live.service.acceptance import WATCHED_S, Acceptance
from compd.live.system import System
from tests.support.patience import PATIENCE_S

CHANNELS = ("scale_1.position", "joints.1", "joints.2")


class AcquisitionClock(System):
    """Virtual time, in which the acquisition does something at each look: `acts` are called with the time, s."""

    def __init__(self, *acts):
        self.now_s = 100.0
        self.acts = acts

    def monotonic(self):
        return self.now_s

    def wait(self, event, duration_s):
        self.now_s += duration_s
        for act in self.acts:
            act(self.now_s - 100.0)
        return False


@pytest.fixture
def trust():
    trust = TrustMemory(CHANNELS, [0.001] * len(CHANNELS))
    for i in range(len(CHANNELS)):
        trust.believe(i, 0.0, 0.0)
    trust.distrust(0, Doubt.JUMPED, 0.25)
    trust.distrust(1, Doubt.RETURNED, 0.02)
    return trust


def accepted(trust, gauge, *acts):
    answers = queue.Queue()
    Acceptance(trust, AcquisitionClock(*acts)).start(gauge, answers.put)
    return json.loads(answers.get(timeout=PATIENCE_S))


def obeys(trust, i, at_s):
    """The thread of the line believes channel `i` from then on."""

    def act(now_s):
        if now_s >= at_s and trust.accepted[i] != trust.obeyed[i]:
            trust.obeyed[i] = trust.accepted[i]
            trust.believe(i, 1.0, now_s)

    return act


def once(at_s, act):
    done = []
    return lambda now_s: None if now_s < at_s or done else done.append(act())


def test_one_that_is_believed_says_for_how_long(trust):
    answer = accepted(trust, "scale_1", obeys(trust, 0, 0.3))
    assert answer["gauges"] == ["scale_1.position"]
    assert answer["believed_for_s"]["scale_1.position"] == pytest.approx(WATCHED_S - 0.3, abs=0.05)
    assert "not_believed" not in answer


def test_one_that_others_contradict_at_once_is_told(trust):
    def contradicted():
        trust.evidence.write({"scale_1.position": "scale_2 and scale_3 say 0.2 mm less"})
        trust.distrust(0, Doubt.VOTED, 0.0)

    answer = accepted(trust, "all", obeys(trust, 0, 0.1), obeys(trust, 1, 0.1), once(0.14, contradicted))
    assert answer["gauges"] == ["joints.1"]
    assert "scale_2 and scale_3 say 0.2 mm less" in answer["not_believed"]["scale_1.position"]


def test_one_that_gives_no_two_answers_that_agree_is_told(trust):
    answer = accepted(trust, "joints")
    assert answer["gauges"] == []
    assert list(answer["not_believed"]) == ["joints.1"]
    assert "moves" in answer["not_believed"]["joints.1"]


def test_where_all_were_believed_the_answer_comes_at_once(trust):
    assert accepted(trust, "joints.2") == {"class": "ACCEPT", "gauges": []}


def test_no_such_gauge(trust):
    with pytest.raises(ValueError, match="no wired gauge is called 'scale_9'"):
        Acceptance(trust, AcquisitionClock()).start("scale_9", print)
