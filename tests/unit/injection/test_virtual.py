"""Cases in virtual time: a process ends, another hangs, devices are exchanged, the computer is busy."""

from __future__ import annotations

import pytest

from tests.injection.run import try_named


@pytest.mark.parametrize("name", ["service-sigkill", "acquisition-sigstop", "scales-replugged"])
def test_what_must_happen_happens(name: str) -> None:
    tried = try_named(name)
    assert tried.result is not None, tried.why
    assert not tried.result["problems"]


def test_a_busy_computer_is_late_until_the_end_of_its_load() -> None:
    tried = try_named("joint-jumps@load")
    assert tried.result is not None, tried.why
    assert not tried.result["problems"]
    assert tried.result["way_out"] == "accepted"
