"""What an order says that it will do: the numbers, for this machine now."""

from __future__ import annotations

import asyncio

import pytest

from compd.errors import DaemonError
from compd.page.daemon_link import DaemonLink
from compd.page.model_files import ModelFiles
from compd.page.orders import Orders

SETPOINT = {
    "valid": True,
    "correction_mm": [0.01, -0.002, 0.003],
    "sources_mm": {"joints": [0.004, 0.0, 0.001], "frame": [0.001, -0.002, 0.002], "link_expansion": [0.005, 0.0, 0.0]},
}


BY = "anna (operate) from 10.0.0.5"


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
    consequence = Orders(link).consequence("zero", "")
    assert consequence.possible
    assert "21 gauges" in consequence.text
    assert "02:06" in consequence.text
    assert "up to 10.0 µm" in consequence.text
    assert consequence.command == "compd zero /run/compd/compd.sock"


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
    consequence = Orders(link).consequence("accept", "all")
    assert consequence.possible
    assert "scale 1: came back 5.000 mm away" in consequence.text
    assert "scale 2" not in consequence.text
    assert Orders(link).consequence("accept", "scale_1").possible
    assert not Orders(link).consequence("accept", "scale_2").possible


def test_a_model_is_adopted_when_its_shadow_has_told_the_change(link):
    assert "no model runs" in Orders(link).consequence("adopt", "/a.yaml").text
    link.models = {"applied": {"effects": []}, "shadow": {"effects": ["backlash"], "file": "/a.yaml"}}
    assert not Orders(link).consequence("adopt", "/a.yaml").possible, "it has no numbers yet"
    link.readings["setpoint"] = SETPOINT | {"shadow": {"correction_mm": [0.0, -0.002, 0.003]}}
    consequence = Orders(link).consequence("adopt", "")
    assert consequence.possible
    assert consequence.subject == "/a.yaml", "without a name it is the shadow's, and never none"
    assert consequence.command == "compd adopt /a.yaml --daemon /run/compd/compd.sock"
    assert "-10.0 µm at link 1" in consequence.text
    assert "0.0 s" in consequence.text


def test_no_model_is_adopted_but_the_one_whose_change_is_told(link):
    """The numbers are the shadow's: another file has others."""
    link.models = {"applied": {"effects": []}, "shadow": {"file": "/a.yaml"}}
    link.readings["setpoint"] = SETPOINT | {"shadow": {"correction_mm": [0.0, -0.002, 0.003]}}
    consequence = Orders(link).consequence("adopt", "/b.yaml")
    assert not consequence.possible
    assert "/a.yaml runs as a shadow, not /b.yaml" in consequence.text


def test_without_effects_the_correction_loses_theirs(link):
    consequence = Orders(link).consequence("no-model", "")
    assert "-5.0 µm at link 1" in consequence.text
    assert consequence.command == "compd adopt --none --daemon /run/compd/compd.sock"
    link.readings = {"setpoint": {"valid": False}}
    consequence = Orders(link).consequence("no-model", "")
    assert consequence.possible
    assert "not known" in consequence.text


def test_a_model_file_is_chosen_by_its_name_or_named_by_its_absolute_path(link, tmp_path):
    (tmp_path / "a model's.model.yaml").touch()
    orders = Orders(link, ModelFiles(tmp_path))
    consequence = orders.consequence("shadow", "a model's.model.yaml")
    assert consequence.possible
    assert consequence.subject == str(tmp_path / "a model's.model.yaml")
    assert "'" in consequence.command, "quoted for the shell"
    elsewhere = orders.consequence("shadow", "/elsewhere/b.yaml")
    assert (elsewhere.possible, elsewhere.subject) == (True, "/elsewhere/b.yaml"), "the daemon looks, the page does not"


@pytest.mark.parametrize("subject", ["", "../a.model.yaml", "b.model.yaml", "./a.model.yaml", "a.model.yaml\x00", "*"])
def test_no_other_name_reaches_the_daemon(link, tmp_path, subject):
    (tmp_path / "models").mkdir()
    for place in (tmp_path, tmp_path / "models"):
        (place / "a.model.yaml").touch()
    orders = Orders(link, ModelFiles(tmp_path / "models"))
    assert not orders.consequence("adopt", subject).possible
    with pytest.raises(DaemonError, match="none of the model files"):
        asyncio.run(orders.do("adopt", subject, BY))
    if subject:
        assert not orders.consequence("shadow", subject).possible
        with pytest.raises(DaemonError, match="none of the model files"):
            asyncio.run(orders.do("shadow", subject, BY))


def test_without_the_daemon_nothing_is_possible(link):
    link.connected, link.reason = False, "it closed the connection"
    for name in ("zero", "accept", "shadow", "adopt", "no-model"):
        consequence = Orders(link).consequence(name, "all")
        assert not consequence.possible
        assert "closed" in consequence.text
