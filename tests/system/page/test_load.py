"""A client that stops reading, ten at once, and clients that mean harm: the others notice nothing."""

from __future__ import annotations

import subprocess
import sys
import threading
from itertools import accumulate, islice
from pathlib import Path

import pytest

from compd.page.broadcast import LIVE_HZ
from tests.support.event_stream import EventStream, cookie_of, host_of, request
from tests.support.live_page import memory_mb, page_process
from tests.support.patience import PATIENCE_S
from tests.support.scripted_page import LOOKS, ORDERS

pytestmark = [pytest.mark.long, pytest.mark.sample]

BROWSERS = 10
# What the system, the server and the client may keep for a client that does not read.
KEPT_OCTETS = 256_000
# Much more than that is made meanwhile.
MADE_OCTETS = 2 * KEPT_OCTETS
GROWTH_MB = 4.0
# The age guard calls an event late from half a second on, and one of the present is later than the quickest by less.
LATE_S, PRESENT_S = 0.6, 0.1
SECRET = "nothing that a browser may have"


class Reader(threading.Thread):
    """Takes live events as they come, until so many octets have."""

    def __init__(self, address, octets):
        super().__init__(daemon=True)
        self._address, self._octets = address, octets
        self.events = []

    def run(self):
        with EventStream(self._address) as stream:
            for event in stream:
                if event.name == "live":
                    self.events.append(event)
                if sum(event.octets for event in self.events) > self._octets:
                    return

    @property
    def made_s(self):
        """When each event was made, on the server's clock."""
        return [event.data["made"] for event in self.events]


def late_s(events):
    """Of each event, against the quickest so far."""
    took_s = [event.arrived_s - event.data["made"] for event in events]
    return [took - quickest for took, quickest in zip(took_s, accumulate(took_s, min), strict=True)]


def test_a_client_that_stops_reading_grows_nothing_and_its_old_events_are_not_shown_as_live(live, tab):
    with EventStream(live.address, receive_buffer_octets=4096) as stalled:
        first = list(islice((event for event in stalled if event.name == "live"), 5))
        before_mb = memory_mb(live.pid)
        readers = [Reader(live.address, MADE_OCTETS) for _ in range(BROWSERS)]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join(PATIENCE_S)
            assert not reader.is_alive()
        assert memory_mb(live.pid) - before_mb < GROWTH_MB
        begin_s, end_s = (pick(reader.made_s[k] for reader in readers) for pick, k in ((max, 0), (min, -1)))
        taken = {tuple(made for made in reader.made_s if begin_s <= made <= end_s) for reader in readers}
        assert len(taken) == 1, "nobody misses what another has"
        stopped_until_s = readers[0].made_s[-1]
        seen, kept, present = first, 0, 0
        for event in stalled:
            if event.name != "live":
                continue
            seen.append(event)
            if event.data["made"] < stopped_until_s - 1.0:
                kept += event.octets
            else:
                present += 1
            if present > 3 * LIVE_HZ and late_s(seen)[-1] < PRESENT_S:
                break
    assert 0 < kept < KEPT_OCTETS
    behind_s = tab.evaluate(
        """async (events) => {
          const { Age } = await import('/static/age.js');
          let now_s = 0;
          const age = new Age(() => now_s);
          return events.map(([arrived_s, made_s]) => {
            now_s = arrived_s;
            age.arrived(made_s);
            return age.behind_s;
          });
        }""",
        [[event.arrived_s, event.data["made"]] for event in seen],
    )
    late = list(zip(late_s(seen), behind_s, strict=True))
    assert max(true_s for true_s, _ in late) > 2.0
    assert all(behind > 0 for true_s, behind in late if true_s > LATE_S)
    assert late[-1][1] == 0, "and the newest is the present"


@pytest.fixture(scope="module")
def cookie(live):
    return cookie_of(live.address)


@pytest.fixture(scope="module")
def outside(live):
    """What recordings' names must not lead to, and links that lead there."""
    live.recordings.mkdir(exist_ok=True)
    secret = live.directory / "secret.csv"
    secret.write_text(SECRET)
    links = {name: live.recordings / name for name in ("linked.csv", "whole.yaml", "nowhere.csv")}
    (live.recordings / "whole.csv").write_text("time_s\n")
    links["linked.csv"].symlink_to(secret)
    links["whole.yaml"].symlink_to(secret)
    links["nowhere.csv"].symlink_to(live.directory / "not there")
    yield secret
    for path in (secret, live.recordings / "whole.csv", *links.values()):
        path.unlink()


@pytest.fixture
def log(live):
    """Nothing in the server fails meanwhile."""
    path = live.directory / "page.log"
    before = path.stat().st_size
    yield
    text = path.read_text()[before:]
    assert "Traceback" not in text, text


def own(live, cookie):
    return {"Cookie": cookie, "Origin": f"http://{host_of(live.address)}"}


@pytest.mark.parametrize(
    ("method", "changed", "code", "reason"),
    [
        ("POST", {"Origin": ""}, 403, "own pages"),
        ("POST", {"Origin": "null"}, 403, "own pages"),
        ("POST", {"Origin": "http://evil.example"}, 403, "own pages"),
        ("POST", {"Origin": "http://["}, 403, "own pages"),
        ("GET", {"Origin": "http://evil.example"}, 403, "own pages"),
        ("GET", {"Origin": "http://127.0.0.1:1"}, 403, "own pages"),
        ("GET", {"Host": "evil.example"}, 400, "this server is not"),
        ("GET", {"Host": "127.0.0.1"}, 400, "this server is not"),
        ("GET", {"Host": ""}, 400, ""),
        ("GET", {"Cookie": ""}, 403, "token"),
        ("GET", {"Cookie": "compd_page_1=wrong"}, 403, "token"),
        ("PUT", {}, 405, "Not Allowed"),
        ("DELETE", {"Origin": ""}, 403, "own pages"),
    ],
)
@pytest.mark.parametrize("target", ["/recordings", "/orders/zero"])
def test_a_request_from_elsewhere_is_refused(live, cookie, log, target, method, changed, code, reason):
    answer = request(live.address, method, target, own(live, cookie) | changed, b"{}")
    assert answer.status == code
    assert reason in answer.text


@pytest.mark.parametrize("token", ["wrong", "", "%00", "%ff%fe", "x" * 10_000])
def test_a_wrong_token_opens_nothing(live, log, token):
    answer = request(live.address, "GET", f"/?token={token}")
    assert answer.status == 403
    assert "set-cookie" not in answer.text.lower()


@pytest.mark.parametrize(
    "target",
    [
        "/recordings/..%2fsecret",
        "/recordings/../secret",
        "/recordings/%2e%2e%2fsecret",
        "/recordings/..%5csecret",
        "/recordings//{directory}/secret",
        "/recordings/%2f{directory}%2fsecret",
        "/recordings/whole%00",
        "/recordings/whole.csv",
        "/recordings/linked",
        "/recordings/nowhere",
        "/recordings/" + 5000 * "a",
        "/static/..%2fserver.py",
        "/static/%2e%2e/server.py",
        "/static//etc/hostname",
        "/static/%00",
        "/static/a%00.js",
        "/static/" + 5000 * "a",
    ],
)
def test_no_path_leads_outside(live, cookie, outside, log, target):
    answer = request(live.address, "GET", target.format(directory=str(live.directory).strip("/")), own(live, cookie))
    assert answer.status in (400, 404, 405)
    assert SECRET not in answer.text


def test_a_recording_has_no_file_from_outside_and_the_list_leaves_links_out(live, cookie, outside, log):
    answer = request(live.address, "GET", "/recordings/whole", own(live, cookie))
    assert answer.status == 200
    assert "whole.csv" in answer.text
    assert "whole.yaml" not in answer.text
    answer = request(live.address, "GET", "/recordings", own(live, cookie))
    assert answer.status == 200
    assert '"whole"' in answer.text
    assert '"linked"' not in answer.text
    assert '"nowhere"' not in answer.text


@pytest.mark.parametrize("target", ["/arm", "/orders/zero", "/orders/accept", "/recordings"])
@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"[]", b"null", b"\xff\xfe", b"[" * 8000, b'{"id":' * 1000, b'{"id": ' + b"9" * 5000 + b"}"],
    ids=["none", "cut", "list", "null", "no text", "nested", "nested objects", "long number"],
)
def test_a_body_that_is_no_order_is_refused(live, cookie, log, target, body):
    answer = request(live.address, "POST", target, own(live, cookie), body)
    assert answer.status == 400
    assert "one JSON object" in answer.text


@pytest.mark.parametrize("headers", [{}, {"Content-Length": "1000000000"}], ids=["true length", "false length"])
def test_a_long_body_is_refused(live, cookie, log, headers):
    answer = request(live.address, "POST", "/arm", own(live, cookie) | headers, b" " * 20_000)
    assert answer.status == 413
    assert "Too Large" in answer.text


def test_a_huge_body_is_not_taken(live, cookie, log):
    before_mb = memory_mb(live.pid)
    answer = request(live.address, "POST", "/arm", own(live, cookie), b" " * 20_000_000)
    assert answer.status in (413, 0), "0: it hung up while the body was still being sent"
    assert memory_mb(live.pid) - before_mb < GROWTH_MB


@pytest.mark.parametrize("id", ['"guessed"', "null", "[]", "{}", "0", '"\\ud800"'])
@pytest.mark.parametrize("target", ["/arm", "/orders/zero", "/orders/no-model"])
def test_an_id_of_nobody_is_refused(live, cookie, log, target, id):
    answer = request(live.address, "POST", target, own(live, cookie), f'{{"id": {id}}}'.encode())
    assert answer.status == 403
    assert "reason" in answer.text


def test_whatever_an_armed_browser_names_is_refused_in_plain_words(live, cookie, log):
    with EventStream(live.address) as stream:
        id = next(iter(stream)).data["id"]
        assert request(live.address, "POST", "/arm", own(live, cookie), f'{{"id": "{id}"}}'.encode()).status == 200
        for order in ("accept", "shadow", "adopt"):
            for subject in ('"\\ud800"', '"\\u0000"', '"no such thing"', "[1]", '"' + "x" * 7000 + '"'):
                body = f'{{"id": "{id}", "subject": {subject}}}'.encode()
                answer = request(live.address, "POST", f"/orders/{order}", own(live, cookie), body)
                assert answer.status == 409, (order, subject, answer.text)
                assert "reason" in answer.text


def test_another_address_without_tokens_does_not_start():
    words = [sys.executable, "-m", "compd", "page", "--daemon", "/no/socket", "--listen", "0.0.0.0", "--port", "0"]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert ended.returncode == 2
    message = " ".join(ended.stderr.split())
    assert "--tokens" in message
    assert "TLS" in message
    assert "open http" not in ended.stdout


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
@pytest.mark.parametrize("options", [(), ("--read-only",)], ids=["with orders", "read-only"])
def test_people_on_other_computers_have_the_roles_of_their_tokens_and_read_only_takes_all_orders(
    tmp_path, host, options
):
    tokens = tmp_path / "tokens.yaml"
    words = [sys.executable, "-m", "compd", "page", "--tokens", str(tokens), "--new-token", f"{ORDERS}:Anna"]
    token = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout.strip()
    listen = ("--listen", host, "--tokens", str(tokens), *options)
    with (
        page_process(Path("/no/socket"), tmp_path / "recordings", *listen) as (address, _),
        EventStream(address.replace("YOUR-TOKEN", token)) as stream,
    ):
        assert next(iter(stream)).data["role"] == (LOOKS if options else ORDERS)
    assert "TLS" in (tmp_path / "page.log").read_text()
