"""What an order says that it will do: the numbers, for this machine now."""

from __future__ import annotations

import asyncio
import hashlib

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
    assert consequence.command == "compd zero --daemon /run/compd/compd.sock"


def test_accept_names_the_gauges_that_wait_and_why(link):
    assert not Orders(link).consequence("accept", "all").possible
    link.status["waits_for_person"] = "waits for a person: look at scale_1, then `compd accept scale_1`"
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
    assert consequence.text.startswith("Waits for a person: look at scale_1, then `compd accept scale_1`")
    assert "scale 2" not in consequence.text
    assert Orders(link).consequence("accept", "scale_1").possible
    assert not Orders(link).consequence("accept", "scale_2").possible


HASH = "0123456789abcdef"


def test_a_model_is_adopted_when_its_shadow_has_told_the_change(link):
    assert "No model runs" in Orders(link).consequence("adopt", "").text
    link.models = {"applied": {"effects": []}, "shadow": {"effects": ["backlash"], "file": "/a.yaml", "model": HASH}}
    assert not Orders(link).consequence("adopt", "").possible, "it has no numbers yet"
    link.readings["setpoint"] = SETPOINT | {"shadow": {"correction_mm": [0.0, -0.002, 0.003]}}
    consequence = Orders(link).consequence("adopt", "")
    assert consequence.possible
    assert consequence.subject == HASH, "what was told is what is adopted, whatever becomes of its file"
    assert consequence.command == "compd model adopt /a.yaml --daemon /run/compd/compd.sock"
    assert "-10.0 µm at link 1" in consequence.text
    assert "0.0 s" in consequence.text


def test_no_model_is_adopted_but_the_one_whose_change_is_told(link, tmp_path):
    """The numbers are the shadow's: another file has others."""
    content = b"a model"
    for name in ("a.model.yaml", "b.model.yaml"):
        (tmp_path / name).write_bytes(content)
    hash_ = hashlib.sha256(content).hexdigest()[:16]
    link.models = {"applied": {"effects": []}, "shadow": {"file": str(tmp_path / "a.model.yaml"), "model": hash_}}
    link.readings["setpoint"] = SETPOINT | {"shadow": {"correction_mm": [0.0, -0.002, 0.003]}}
    orders = Orders(link, ModelFiles(tmp_path))
    assert orders.consequence("adopt", "a.model.yaml").subject == hash_
    (tmp_path / "b.model.yaml").write_bytes(b"another")
    assert "a.model.yaml runs as a shadow, not" in orders.consequence("adopt", "b.model.yaml").text
    (tmp_path / "a.model.yaml").write_bytes(b"changed")
    assert not orders.consequence("adopt", "a.model.yaml").possible
    assert "Another model runs" in orders.consequence("adopt", HASH).text
    assert not orders.consequence("adopt", HASH).possible


def test_without_effects_the_correction_loses_theirs(link):
    consequence = Orders(link).consequence("no-model", "")
    assert "-5.0 µm at link 1" in consequence.text
    assert consequence.command == "compd model adopt --none --daemon /run/compd/compd.sock"
    link.readings = {"setpoint": {"valid": False}}
    consequence = Orders(link).consequence("no-model", "")
    assert consequence.possible
    assert "not known" in consequence.text


def test_a_model_file_is_chosen_by_its_name(link, tmp_path):
    (tmp_path / "a model's.model.yaml").touch()
    consequence = Orders(link, ModelFiles(tmp_path)).consequence("shadow", "a model's.model.yaml")
    assert consequence.possible
    assert str(tmp_path) in consequence.command
    assert "'" in consequence.command, "quoted for the shell"


@pytest.mark.parametrize(
    "subject",
    [
        *["", "../a.model.yaml", "b.model.yaml", "./a.model.yaml", "a.model.yaml\x00", "*", "/etc/shadow"],
        *["exports/evil.yaml", "link.model.yaml", "ABSOLUTE"],
    ],
)
def test_no_other_name_reaches_the_daemon(link, tmp_path, subject, monkeypatch):
    """Nor an absolute path of a file that a browser has brought to this computer."""
    monkeypatch.setattr("compd.page.orders.connect", lambda *_, **__: pytest.fail("the daemon was asked"))
    models = tmp_path / "models"
    (models / "exports").mkdir(parents=True)
    for place in (tmp_path / "a.model.yaml", models / "a.model.yaml", models / "exports" / "evil.yaml"):
        place.touch()
    (models / "link.model.yaml").symlink_to(tmp_path / "a.model.yaml")
    subject = str(models / "exports" / "evil.yaml") if subject == "ABSOLUTE" else subject
    orders = Orders(link, ModelFiles(models))
    assert not orders.consequence("adopt", subject).possible
    with pytest.raises(DaemonError, match="named by its hash"):
        asyncio.run(orders.do("adopt", subject, BY))
    if subject:
        assert not orders.consequence("shadow", subject).possible
        with pytest.raises(DaemonError, match="not a model file"):
            asyncio.run(orders.do("shadow", subject, BY))


def test_without_the_daemon_nothing_is_possible(link):
    link.connected, link.reason = False, "it closed the connection"
    for name in ("zero", "accept", "shadow", "adopt", "no-model"):
        consequence = Orders(link).consequence(name, "all")
        assert not consequence.possible
        assert "closed" in consequence.text


def test_a_correction_of_the_tip_is_told_along_an_axis(link):
    sources = {"joints": [0.0] * 3, "frame": [0.0] * 3, "growth": [0.0, 0.002, -0.02]}
    pose = {"valid": True, "tip_correction_mm": [0.0, 0.002, -0.02], "sources_mm": sources}
    link.readings = {"setpoint": pose}
    assert "+20.0 µm along z" in Orders(link).consequence("no-model", "").text
    link.models = {"applied": {"effects": []}, "shadow": {"effects": ["backlash"], "file": "/a.yaml", "model": HASH}}
    link.readings = {"setpoint": pose | {"shadow": {"tip_M_mm": [0.0] * 3}}}
    assert "the tip of this machine is corrected" in Orders(link).consequence("adopt", "").text
