"""Clients that are slow, ask without end or go within a line disturb nobody else."""

from __future__ import annotations

import pytest

from compd.live.service import Publisher
from tests.worlds.plan import Event, Plan
from tests.worlds.run import play


def event(time_s: float, kind: str, **parameters: object) -> Event:
    return Event(time_s, "clients", kind, "", parameters)


def test_the_others_miss_nothing() -> None:
    events = [
        event(0.1, "slow", lasts_s=3.0),
        event(0.3, "flood", per_s=1000.0, lasts_s=1.0),
        *(event(0.5 + 0.3 * k, "half_line", what=what) for k, what in enumerate(("request", "target", "noise"))),
    ]
    report = play(Plan("tripod-cmm.yaml", 31, 3.5, 500.0, tuple(events)))
    assert not report.findings, list(map(str, report.findings))
    assert report.valid_share == 1.0


def test_a_publisher_that_waits_for_a_client_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    serve = Publisher._serve

    def wait(publisher: Publisher, session: object, events: int) -> None:
        publisher._system.sleep_until(publisher._system.monotonic() + 0.3)
        serve(publisher, session, events)  # type: ignore[arg-type]

    monkeypatch.setattr(Publisher, "_serve", wait)
    report = play(Plan("tripod-cmm.yaml", 31, 2.0, 500.0, (event(0.1, "flood", per_s=100.0, lasts_s=1.0),)))
    assert "nobody_waits" in {finding.what for finding in report.findings}
