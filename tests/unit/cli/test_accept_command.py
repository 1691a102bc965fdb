"""`compd accept` and `compd zero`: what a person is told, and asked."""

from __future__ import annotations

from contextlib import nullcontext

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.cli.live.accept import not_believed
from compd.cli.live.zero import changes_text

GAUGES = [
    {"channel": "scale_1.position", "quality": "distrusted", "detail": "came back 5.000 mm away: reference it"},
    {"channel": "joints.1", "quality": "distrusted", "detail": "jumped"},
    {"channel": "joints.2", "quality": "distrusted", "detail": "jumped"},
    {"channel": "joints.3", "quality": "ok"},
    {"channel": "cabinet.t1", "quality": "timeout"},
]
STOP = {"state": "stop", "reason": "the tip is not known"}


def test_each_gauge_that_is_not_believed_is_told_with_what_to_type():
    status = {"gauges": GAUGES, "waits_for_person": "waits for a person: look at scale_1, joints"}
    lines = not_believed(status, STOP)
    assert lines[:2] == [status["waits_for_person"], "scale_1.position: came back 5.000 mm away: reference it"]
    assert lines[-3:] == ["    compd accept scale_1", "    compd accept joints", "    compd accept all"]
    assert not any("cabinet" in line or "joints.3" in line for line in lines)


def test_a_fault_is_told_and_acknowledged_by_all():
    lines = not_believed({"gauges": GAUGES[3:]}, {"state": "fault", "reason": "scale 1 stands still"})
    assert lines == ["fault: scale 1 stands still", "", "When you have looked at it:", "    compd accept all"]


def test_where_every_gauge_is_believed_that_is_said():
    assert not_believed({"gauges": GAUGES[3:]}, STOP) == ["every gauge is believed"]


class Answers:
    """A client whose daemon answers every `accept` so."""

    def __init__(self, answer):
        self.answer = answer

    def accept(self, gauge):
        return self.answer


@pytest.mark.parametrize(
    ("answer", "printed", "code"),
    [
        (
            {"gauges": ["scale_1.position"], "believed_for_s": {"scale_1.position": 0.98}},
            "scale_1.position: believed for 1.0 s\n",
            0,
        ),
        (
            {"gauges": [], "not_believed": {"scale_1.position": "jumped"}},
            "scale_1.position: still not believed: jumped\n",
            1,
        ),
        ({"gauges": []}, "scale_1: was believed already\n", 0),
    ],
)
def test_what_has_become_of_an_accepted_gauge(answer, printed, code, monkeypatch):
    monkeypatch.setattr("compd.client.connect", lambda *_: nullcontext(Answers(answer)))
    result = CliRunner().invoke(app, ["accept", "scale_1"])
    assert (result.output, result.exit_code) == (printed, code)


def test_the_differences_to_the_zero_before_fit_a_terminal_the_largest_first():
    changed_mm = {f"a_gauge_with_a_name.{k}": 1e-5 * k for k in range(21)} | {"scale_1.position": -5.0}
    lines = changes_text(changed_mm).splitlines()
    assert "scale_1.position" in lines[1]
    assert "-5000.00 um" in lines[1]
    assert "13 others" in lines[-1]
    assert all(len(line) <= 80 for line in lines)
