"""Whatever JSON the workbench and the join wizard are sent: an answer or a refusal, and never a fault."""

from __future__ import annotations

import json

import pytest
from starlette.testclient import TestClient

from compd.page.daemon_link import DaemonLink
from compd.page.guard import Guard, Token, hashed
from compd.page.recordings import Recordings
from compd.page.server import Server
from tests.support.measured import gauges, hidden, record
from tests.support.sampled import sampled

HOST = "127.0.0.1:7760"
BASE = "/workbench/run/a.model.yaml"
OPEN = {"recording": "run", "model": "a.model.yaml", "libraries": []}
K = {"unit": "um/pct", "plausible": [0, 1], "source": "notes"}
DECLARATION = {"id": "swelling", "port": "link", "formula": "k * (humidity_pct - 50)", "parameters": {"k": K}}
JOIN = {
    **{"export": "points.csv", "recording": "run", "plan": "", "name": "joined", "columns": ["x", "y", "z"]},
    **{"shape": "csv", "unit": "mm", "angle_unit": "rad", "decimal": ".", "dates": "dmy", "rate_hz": 50.0},
    **{"group": "", "sheet": "", "by": "order", "frame": "machine", "sigma_um": 1.0, "sigma_urad": 1.0, "link": 1},
    **{"ball": 1, "offset_s": 0.5, "moving": True},
}
ORDERS = {
    "/workbench/open": OPEN,
    f"{BASE}/step": {"kind": "add", "effect": "link_expansion", "revision": 1, "dry_run": True},
    f"{BASE}/exclusions": {"rows": [3], "reason": "fog", "revision": 1},
    f"{BASE}/diagnosis": {"cancel": True},
    f"{BASE}/formula": {"declaration": DECLARATION},
    f"{BASE}/own": {"declaration": DECLARATION, "replace": False, "delete": "swelling"},
    f"{BASE}/plan": {
        "rivals": ["link_expansion"],
        "beside": [],
        "rows": 4,
        "workspace": None,
        "limits": {},
        "force": 1,
    },
    "/join/table": JOIN,
    "/join/trial": JOIN,
    "/join/recording": JOIN,
}
NESTED = [[[{"a": [{}, None]}]]]
JUNK = (None, [], {}, 1e308, "", NESTED, 10**400, -(2**63), True, [{}], "\ud800", "\x00")


@pytest.fixture
def no_worker_outlives_its_test():
    """They serve the next one, too."""


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    directory = tmp_path_factory.mktemp("recordings")
    record(directory, gauges(90, 1), [hidden("link_elasticity", 40.0)])
    (directory / "exports").mkdir()
    (directory / "exports" / "points.csv").write_text("x,y,z\n1.5,2.5,3.5\n4.5,5.5,6.5\n")
    server = Server(DaemonLink("/no/socket"), Recordings(directory, "/no/socket"))
    app = Guard(server.app(), [Token("a person", "operate", hashed("x"))], [f"http://{HOST}"], 7760)
    client = TestClient(app, base_url=f"http://{HOST}", headers={"Origin": f"http://{HOST}"})
    client.get("/", params={"token": "x"})
    client.directory = directory
    yield client
    server._workers.end()


@pytest.mark.parametrize(("path", "key"), sampled([(path, key) for path, keys in ORDERS.items() for key in keys], 5))
def test_a_key_of_another_type_is_answered_or_refused(client, path, key):
    if path.startswith(BASE):
        assert client.post("/workbench/open", content=json.dumps(OPEN)).status_code == 200
    for junk in JUNK:
        answer = client.post(path, content=json.dumps({**ORDERS[path], key: junk}))
        assert answer.status_code in (200, 400, 404, 409, 413), (path, key, junk, answer.text)


@pytest.mark.parametrize("libraries", [[{}], [None], [[]], [1], {}, "text", 3, True])
def test_libraries_that_are_no_names_are_refused(client, libraries):
    answer = client.post("/workbench/open", json={**OPEN, "libraries": libraries})
    assert answer.status_code == 400
    assert "list of names" in answer.text


def test_a_model_file_that_is_a_link_is_not_opened(client, tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("s3cr3t")
    (client.directory / "link.model.yaml").symlink_to(secret)
    (client.directory / "nowhere.model.yaml").symlink_to(tmp_path / "none")
    (client.directory / "folder.model.yaml").mkdir()
    for name in ("link", "nowhere", "folder"):
        answer = client.post("/workbench/open", json={**OPEN, "model": f"{name}.model.yaml"})
        assert answer.status_code == 409
        assert "a link or no file" in answer.text
        assert "s3cr3t" not in answer.text
