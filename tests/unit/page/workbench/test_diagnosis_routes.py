"""What a browser asks of a diagnosis: the newest, of which state of the model, and its page in a sandbox."""

from __future__ import annotations

import json

import pytest
from starlette.testclient import TestClient

from compd.page.daemon_link import DaemonLink
from compd.page.guard import CONTENT_SECURITY_POLICY, Guard, Token, hashed
from compd.page.recordings import Recordings
from compd.page.server import Server
from compd.page.workbench.diagnoses import MAX_RUNNING
from tests.support.measured import gauges, hidden, record
from tests.support.patience import PATIENCE_S

HOST = "127.0.0.1:7760"
OPEN = {"recording": "run", "model": "a.model.yaml"}
BASE = "/workbench/run/a.model.yaml"


@pytest.fixture
def client(tmp_path):
    record(tmp_path, gauges(200, 1), [hidden("link_expansion", 5.0)])
    server = Server(DaemonLink("/no/socket"), Recordings(tmp_path, "/no/socket"))
    app = Guard(server.app(), [Token("a person", "operate", hashed("x"))], [f"http://{HOST}"], 7760)
    client = TestClient(app, base_url=f"http://{HOST}", headers={"Origin": f"http://{HOST}"})
    client.get("/", params={"token": "x"})
    client.server = server
    yield client
    for workbench in opened(client).values():
        if workbench.diagnosis is not None:
            workbench.diagnosis.cancel()
            workbench.diagnosis.join(PATIENCE_S)


def opened(client):
    return client.server._workbench._open


def begun(client, model=OPEN["model"]):
    answer = client.post("/workbench/open", json=OPEN | {"model": model}).json()
    return client.post(f"/workbench/{answer['key']}/diagnosis", json={}), answer["revision"]


def test_before_the_first_there_is_none(client):
    client.post("/workbench/open", json=OPEN)
    assert client.get(f"{BASE}/diagnosis").json() == {"state": "none"}
    assert client.get(f"{BASE}/diagnosis/page").status_code == 404
    assert client.post(f"{BASE}/diagnosis", json={"cancel": True}).json() == {"state": "none"}


@pytest.mark.long
@pytest.mark.sample
def test_every_browser_gets_the_newest_and_is_told_that_the_model_has_changed_since(client):
    answer, revision = begun(client)
    running = answer.json()
    assert running["state"] == "running"
    assert client.post(f"{BASE}/diagnosis", json={}).json()["id"] == running["id"], "a second browser joins it"
    opened(client)[False, "run/a.model.yaml"].diagnosis.join(PATIENCE_S)
    answer = client.get(f"{BASE}/diagnosis", params={"shown": "another"}).json()
    assert (answer["state"], answer["behind"]) == ("done", 0)
    assert answer["evidence"]["effects"][0]["effect"] == "link_expansion"
    assert "evidence" not in client.get(f"{BASE}/diagnosis", params={"shown": answer["id"]}).json()
    step = {"kind": "add", "effect": "link_expansion", "revision": revision}
    assert client.post(f"{BASE}/step", json=step).status_code == 200
    assert client.get(f"{BASE}/diagnosis", params={"shown": answer["id"]}).json()["behind"] == 1


def test_its_page_runs_its_own_scripts_in_a_sandbox(client):
    begun(client)
    opened(client)[False, "run/a.model.yaml"].diagnosis.join(PATIENCE_S)
    page = client.get(f"{BASE}/diagnosis/page")
    policies = page.headers.get_list("content-security-policy")
    assert len(policies) == 1
    assert policies[0].startswith("sandbox allow-scripts")
    assert "allow-same-origin" not in policies[0]
    assert "default-src 'none'" in policies[0]
    assert "link_expansion" in page.text
    assert client.get("/workbench").headers.get_list("content-security-policy") == [CONTENT_SECURITY_POLICY]


def test_too_many_are_refused_in_words(client):
    for k in range(MAX_RUNNING // 4):
        assert begun(client, f"{k}.model.yaml")[0].status_code == 200
    refusal, _ = begun(client)
    assert refusal.status_code == 409
    assert "run already on this server" in refusal.json()["reason"]
    assert "at once for one token" in refusal.json()["reason"]


@pytest.mark.parametrize("keys", [{"cancel": "x"}, {"cancel": [[]]}, {"shown": {}}, {"\ud800": "\ud800"}])
def test_hostile_keys_do_no_harm(client, keys):
    client.post("/workbench/open", json=OPEN)
    assert client.post(f"{BASE}/diagnosis", content=json.dumps(keys)).status_code == 200
    assert client.get(f"{BASE}/diagnosis", params={"shown": "\x00" * 2000}).status_code == 200
