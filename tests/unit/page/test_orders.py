"""What an order says that it will do: the numbers, for this machine now."""

from __future__ import annotations

import pytest

from compd.page.daemon_link import DaemonLink
from compd.page.orders import Orders

SETPOINT = {
    "valid": True,
    "correction_mm": [0.01, -0.002, 0.003],
    "sources_mm": {"joints": [0.004, 0.0, 0.001], "frame": [0.001, -0.002, 0.002], "link_expansion": [0.005, 0.0, 0.0]},
}


@pytest.fixture
def link():
    link = DaemonLink("/run/compd/compd.sock", connected=True, reason="")
    link.machine = {
        "limits": {"slew_mm_per_s": 0.5},
        "wiring": [{"kind": "scale"}] * 3 + [{"kind": "joint"}] * 9 + [{"kind": "frame"}] * 9 + [{"kind": "quantity"}],
    }
    link.status = {"zero": {"taken": True, "taken_at": "2026-11-20T02:06:00+00:00"}, "gauges": []}
    link.readings = {"setpoint": SETPOINT}
    return link


def test_zero_names_the_gauges_the_old_zero_and_what_becomes_of_the_correction(link):
    told = Orders(link).consequence("zero", "")
    assert told.possible
    assert "21 gauges" in told.text
    assert "02:06" in told.text
    assert "up to 10.0 um" in told.text
    assert told.command == "compd zero /run/compd/compd.sock"


def test_accept_names_the_gauges_that_wait_and_why(link):
    assert not Orders(link).consequence("accept", "all").possible
    link.status["gauges"] = [
        {
            "channel": "scale_1.position",
            "quality": "distrusted",
            "measures": "scale 1",
            "detail": "came back 5.000 mm away",
        },
        {"channel": "scale_2.position", "quality": "ok", "measures": "scale 2"},
    ]
    told = Orders(link).consequence("accept", "all")
    assert told.possible
    assert "scale 1: came back 5.000 mm away" in told.text
    assert "scale 2" not in told.text
    assert Orders(link).consequence("accept", "scale_1").possible
    assert not Orders(link).consequence("accept", "scale_2").possible


def test_a_model_is_adopted_when_its_shadow_has_told_the_change(link):
    assert not Orders(link).consequence("adopt", "/a.yaml").possible
    link.model = {"applied": {"effects": []}, "shadow": {"file": "/a.yaml"}}
    assert not Orders(link).consequence("adopt", "/a.yaml").possible
    link.readings["setpoint"] = SETPOINT | {"shadow": {"correction_mm": [0.0, -0.002, 0.003]}}
    told = Orders(link).consequence("adopt", "/a.yaml")
    assert told.possible
    assert "-10.0 um at link 1" in told.text
    assert "0.0 s" in told.text
    assert told.command == "compd adopt /a.yaml --daemon /run/compd/compd.sock"


def test_no_model_is_adopted_but_the_one_whose_change_is_told(link):
    """The numbers are the shadow's: another file has others, and no file would be no model at all."""
    link.model = {"applied": {"effects": []}, "shadow": {"file": "/a.yaml"}}
    link.readings["setpoint"] = SETPOINT | {"shadow": {"correction_mm": [0.0, -0.002, 0.003]}}
    told = Orders(link).consequence("adopt", "/b.yaml")
    assert not told.possible
    assert "/a.yaml runs as a shadow, not /b.yaml" in told.text
    assert Orders(link).consequence("adopt", "").command.startswith("compd adopt /a.yaml ")


def test_without_effects_the_correction_loses_theirs(link):
    told = Orders(link).consequence("no-model", "")
    assert "-5.0 um at link 1" in told.text
    assert told.command == "compd adopt --none --daemon /run/compd/compd.sock"
    link.readings = {"setpoint": {"valid": False}}
    told = Orders(link).consequence("no-model", "")
    assert told.possible
    assert "not known" in told.text


def test_a_shadow_needs_a_file_that_is_there(link, tmp_path):
    assert not Orders(link).consequence("shadow", str(tmp_path / "none.yaml")).possible
    file = tmp_path / "a model's.yaml"
    file.touch()
    told = Orders(link).consequence("shadow", str(file))
    assert told.possible
    assert "'" in told.command, "quoted for the shell"


def test_without_the_daemon_nothing_is_possible(link):
    link.connected, link.reason = False, "it closed the connection"
    for name in ("zero", "accept", "shadow", "adopt", "no-model"):
        told = Orders(link).consequence(name, "all")
        assert not told.possible
        assert "closed" in told.text
