"""Formula, own effects and plans over HTTP: who may write, what hostile requests get, and that no path is read."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from compd.page.daemon_link import DaemonLink
from compd.page.guard import Guard, Token, hashed
from compd.page.recordings import Recordings
from compd.page.server import Server
from compd.page.workbench import routes
from tests.support.measured import gauges, hidden, record
from tests.support.patience import PATIENCE_S
from tests.support.sampled import sampled

HOST = "127.0.0.1:7760"
OWN = {"Origin": f"http://{HOST}"}
BASE = "/workbench/run/tripod.model.yaml"
K = {"unit": "um/pct", "plausible": [0, 1], "source": "notes"}
GOOD = {"id": "swelling", "port": "link", "formula": "k * (humidity_pct - 50)", "parameters": {"k": K}}
JUNK = (None, [], 3, "text", {}, True, {"id": "\ud800"}, {**GOOD, "physics": "\ud800"}, {**GOOD, "\ud800": 1})


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("recordings")
    record(directory, gauges(90, 1), [hidden("link_elasticity", 40.0)])
    return directory


@pytest.fixture
def client_of(directory, tmp_path):
    """A client with a token of a role, and the recording open."""

    def opened(role):
        server = Server(DaemonLink("/no/socket"), Recordings(directory, "/no/socket"), tmp_path)
        app = Guard(server.app(), [Token("a person", role, hashed("x"))], [f"http://{HOST}"], 7760)
        client = TestClient(app, base_url=f"http://{HOST}")
        client.get("/", params={"token": "x"})
        keys = {"recording": "run", "model": "tripod.model.yaml"}
        assert client.post("/workbench/open", json=keys, headers=OWN).status_code == 200
        return client

    return opened


def post(client, path, keys):
    return client.post(f"{BASE}/{path}", content=json.dumps(keys), headers=OWN)


def workbench_threads():
    return [thread for thread in threading.enumerate() if thread.name.startswith("worker workbench")]


def test_what_cannot_be_opened_leaves_nothing_behind(client_of, directory):
    client = client_of("view")
    (directory / "plan.csv").write_text("u_1_mm\n1\n")
    before = workbench_threads()
    for k in range(3):
        keys = {"recording": "plan", "model": f"n{k}.model.yaml"}
        assert client.post("/workbench/open", json=keys, headers=OWN).status_code == 409
    (directory / "plan.csv").unlink()
    for thread in workbench_threads():
        if thread not in before:
            thread.join(PATIENCE_S)
    assert set(workbench_threads()) <= set(before)


@pytest.mark.long
@pytest.mark.sample
def test_only_so_many_are_open_and_the_oldest_makes_room(client_of, monkeypatch):
    monkeypatch.setattr(routes, "MAX_OPEN", 2)
    client = client_of("view")
    for model in ("b.model.yaml", "c.model.yaml"):
        assert client.post("/workbench/open", json={"recording": "run", "model": model}, headers=OWN).status_code == 200
    assert client.get(f"{BASE}/effects").status_code == 404
    assert client.get("/workbench/run/c.model.yaml/effects").status_code == 200


def test_who_may_only_look_may_try_and_writes_nothing(client_of, tmp_path):
    client = client_of("view")
    draft = post(client, "formula", {"declaration": GOOD}).json()["draft"]["effect"]
    assert client.get(f"{BASE}/effects/{draft}").json()["effect"] == "swelling"
    assert client.get(f"{BASE}/effects/{draft}/0").status_code == 200
    assert post(client, "step", {"kind": "add", "effect": draft, "dry_run": True}).json()["rms"]
    assert post(client, "own", {"declaration": GOOD}).status_code == 403
    assert post(client, "own", {"delete": "swelling"}).status_code == 403
    assert list(tmp_path.glob("*.yaml")) == []


def test_who_may_operate_saves_and_deletes(client_of, tmp_path):
    client = client_of("operate")
    answer = post(client, "own", {"declaration": GOOD})
    assert f"--effects {tmp_path / 'own.effects.yaml'}" in answer.json()["commands"]["diagnose"]
    (own,) = (entry for entry in client.get(f"{BASE}/effects").json()["effects"] if entry["own"])
    assert own["effect"] == "swelling"
    assert client.get(f"{BASE}/effects/swelling").json()["named"] == f"{tmp_path / 'own.effects.yaml'}:swelling"
    assert post(client, "own", {"declaration": GOOD}).status_code == 409
    assert post(client, "own", {"declaration": GOOD, "replace": True}).status_code == 200
    assert post(client, "own", {"delete": "swelling"}).status_code == 200
    assert list(tmp_path.glob("*.yaml")) == []


@pytest.mark.parametrize("declaration", sampled(JUNK, 5))
@pytest.mark.parametrize("path", ["formula", "own"])
def test_what_is_no_effect_has_an_answer(client_of, path, declaration, tmp_path):
    assert post(client_of("operate"), path, {"declaration": declaration}).status_code in (200, 400, 409)
    assert list(tmp_path.glob("*.yaml")) == []


@pytest.mark.parametrize("effect", sampled([None, 3, [], {}, "\ud800", "../own", "none"], 5))
def test_what_is_not_there_is_not_deleted(client_of, effect):
    assert post(client_of("operate"), "own", {"delete": effect}).status_code == 409


def test_a_name_that_is_a_path_loads_no_code(client_of, tmp_path):
    code = tmp_path / "mine.py"
    code.write_text(f"from pathlib import Path\nPath({str(tmp_path / 'ran')!r}).touch()\n")
    client = client_of("operate")
    for name in (f"{code}:MINE", f"{code}"):
        assert post(client, "step", {"kind": "add", "effect": name, "dry_run": True}).status_code == 409
        assert post(client, "plan", {"rivals": [name, "joint_contact"], "rows": 4}).json()["problems"]
        client.get(f"{BASE}/plan", params={"rivals": name})
    assert not Path(tmp_path / "ran").exists()


def test_a_plan_is_made_and_its_files_are_given(client_of):
    client = client_of("view")
    form = client.get(f"{BASE}/plan").json()
    assert len(form["limits"]["workspace"]) == 3
    answer = post(client, "plan", {"rivals": ["link_elasticity", "joint_contact"], "rows": 8}).json()
    assert answer["rows"]
    assert len(answer["difference_um"]) == len(answer["place"]) == len(answer["rows"])
    file = client.get(f"{BASE}/plan/{answer['key']}/plan")
    assert file.headers["content-disposition"] == 'attachment; filename="run-plan.csv"'
    assert len(file.text.splitlines()) == len(answer["rows"]) + 1
    assert client.get(f"{BASE}/plan/{answer['key']}/gcode").status_code == 409
    for query in ("feed=x", "feed=nan", "feed=0", "feed=inf", "feed=1200&dwell=-1"):
        assert client.get(f"{BASE}/plan/{answer['key']}/gcode?{query}").status_code == 409
    assert client.get(f"{BASE}/plan/{answer['key']}/gcode?feed=1200").status_code == 200
    for path in ("nothing/plan", f"{answer['key']}/exe"):
        assert client.get(f"{BASE}/plan/{path}").status_code == 404


def test_on_a_machine_of_an_external_model_there_are_columns_and_their_limits(tmp_path):
    lines = ["elevation_deg,azimuth_deg,model_x_mm,model_y_mm,reference_x_mm,reference_y_mm"]
    for k in range(60):
        elevation, azimuth = 20 + 65 * (k * 7 % 60) / 60, -90 + 180 * (k * 11 % 60) / 60
        lines.append(f"{elevation},{azimuth},{k},{-k},{k + elevation / 1e4},{-k + azimuth / 1e5 + k % 3 / 1e4}")
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    sidecar = "format: 2\nmachine: external\nreference: {quantity: tool_position, frame: machine}\n"
    (tmp_path / "run.yaml").write_text(sidecar)
    own = "- {{id: {}, port: reference, axis: x, formula: k * {}_deg, parameters: {{k: {}}}}}\n"
    numbers = "{unit: um/deg, plausible: [-1, 1], source: notes}"
    text = own.format("sag", "elevation", numbers) + own.format("turn", "azimuth", numbers)
    (tmp_path / "own.effects.yaml").write_text(text)
    server = Server(DaemonLink("/no/socket"), Recordings(tmp_path, "/no/socket"), tmp_path)
    app = Guard(server.app(), [Token("a person", "view", hashed("x"))], [f"http://{HOST}"], 7760)
    client = TestClient(app, base_url=f"http://{HOST}")
    client.get("/", params={"token": "x"})
    opened = client.post("/workbench/open", json={"recording": "run", "model": "tripod.model.yaml"}, headers=OWN)
    assert opened.status_code == 200, opened.text
    assert [port["port"] for port in client.get(f"{BASE}/formula").json()["ports"]] == ["reference"]
    limits = client.get(f"{BASE}/plan", params={"rivals": "sag,turn"}).json()["limits"]["columns"]
    assert limits["elevation_deg"] == [20.0, pytest.approx(83.92, abs=0.01)]
    asked = {"rivals": ["sag", "turn"], "rows": 6, "limits": {"elevation_deg": [30, 60]}}
    answer = post(client, "plan", asked).json()
    assert f"--effects {tmp_path / 'own.effects.yaml'}" in answer["command"]
    assert set(answer["files"]) == {"plan", "csv"}
    assert all(30 <= row[answer["columns"].index("elevation_deg")] <= 60 for row in answer["rows"])
    wrong = post(client, "plan", {**asked, "limits": {"elevation_deg": [60, 30]}}).json()["problems"]
    assert [problem["field"] for problem in wrong] == ["limit of elevation_deg"]
