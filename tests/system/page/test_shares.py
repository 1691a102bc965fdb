"""A token that may only look does its worst; events of others stay in time, and whoever operates is served at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.support.command import run_in_process
from tests.support.event_stream import connected, cookie_of, host_of, request
from tests.support.live_page import page_process, running_machine
from tests.support.measured import gauges, hidden, record
from tests.support.other_process import family
from tests.support.patience import PATIENCE_S
from tests.system.page.test_workers import LATE_S, gaps

pytestmark = [pytest.mark.long, pytest.mark.sample]

# On a computer that opens it within 0.35 s in a quiet time, as an idle one does; on a slower one as many times more.
OPENS_WITHIN_S, QUIET_S = 2.0, 0.35
RECORDING_BYTES = 29e6
DOWNLOADS, WORKBENCHES = 34, 9


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    with running_machine() as (directory, _):
        recordings = directory / "recordings"
        recordings.mkdir()
        campaign = ("sim", "campaign", str(directory / "tripod-cmm.yaml"), "--hidden", "8")
        run_in_process(*campaign, "--out", str(recordings / "run.csv"))
        record(recordings, gauges(20_000, 1), [hidden("link_expansion", 5.0)], name="long")
        text = (recordings / "run.csv").read_bytes()
        (recordings / "large.csv").write_bytes(text * int(1 + RECORDING_BYTES // len(text)))
        tokens = directory / "tokens.yaml"
        role_of = {"view": "view:screen", "operate": "operate:anna"}
        made = {role: new_token(tokens, name) for role, name in role_of.items()}
        options = ("--listen", "127.0.0.1", "--tokens", str(tokens))
        with page_process(directory / "compd.sock", recordings, *options) as (address, pid):
            addresses = {role: address.replace("YOUR-TOKEN", token) for role, token in made.items()}
            yield SimpleNamespace(
                pid=pid,
                addresses=addresses,
                headers={
                    role: {"Cookie": cookie_of(one), "Origin": f"http://{host_of(one)}"}
                    for role, one in addresses.items()
                },
                origin=f"http://{host_of(address)}/",
            )


def new_token(tokens, role_and_name):
    words = [sys.executable, "-m", "compd", "page", "--tokens", str(tokens), "--new-token", role_and_name]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def ask(page, role, target, keys):
    return request(page.origin, "POST", target, page.headers[role], json.dumps(keys).encode())


def sent(page, role, method, target, keys=None):
    """A connection with a request of which nothing is read."""
    body = b"" if keys is None else json.dumps(keys).encode()
    lines = [f"{method} {target} HTTP/1.1", f"Host: {host_of(page.origin)}", f"Content-Length: {len(body)}"]
    lines += [f"{name}: {value}" for name, value in page.headers[role].items()]
    connection = connected(page.origin, receive_buffer_octets=4096)
    connection.sendall("\r\n".join([*lines, "", ""]).encode() + body)
    return connection


def read(connection, stopped):
    """Read as fast as it comes."""
    try:
        while not stopped.is_set() and connection.recv(1 << 16):
            pass
    except OSError:
        return


@contextmanager
def worst(page):
    """Downloads, half of them read; workbenches of the operator's recording; heads that never end."""
    stopped = threading.Event()
    with ExitStack() as stack:
        downloads = [stack.enter_context(sent(page, "view", "GET", "/recordings/large")) for _ in range(DOWNLOADS)]
        readers = [threading.Thread(target=read, args=(one, stopped), daemon=True) for one in downloads[::2]]
        for reader in readers:
            reader.start()
        for k in range(WORKBENCHES):
            keys = {"recording": "run", "model": f"m{k}.model.yaml"}
            stack.enter_context(sent(page, "view", "POST", "/workbench/open", keys))
        for _ in range(WORKBENCHES):
            target = "/workbench/run/m0.model.yaml/diagnosis"
            stack.enter_context(sent(page, "view", "POST", target, {}))
        for _ in range(WORKBENCHES):
            stack.enter_context(connected(page.origin)).sendall(b"GET / HTTP/1.1\r\nHost: ")
        yield
        stopped.set()


def test_live_events_are_in_time_and_an_operator_s_workbench_opens(page):
    def opened(model):
        began_s = time.monotonic()
        answer = ask(page, "operate", "/workbench/open", {"recording": "run", "model": f"{model}.model.yaml"})
        assert answer.status == 200, answer.text
        return time.monotonic() - began_s

    first_s, quiet_s = opened("first"), opened("second")  # the first waits for what is imported
    with gaps(page.addresses["operate"]) as busy, worst(page):
        threading.Event().wait(2.0)  # the time over which is measured
        opened_s = opened("m0")
        threading.Event().wait(1.0)
    print(f"opened within {opened_s:.2f} s, {quiet_s:.2f} s in a quiet time, {first_s:.2f} s at first")
    print(f"the longest gap between live events is {max(busy):.3f} s")
    assert opened_s < OPENS_WITHIN_S * max(1.0, quiet_s / QUIET_S)
    assert max(busy) < LATE_S


def until(fulfilled):
    until_s = time.monotonic() + PATIENCE_S
    while not fulfilled():
        assert time.monotonic() < until_s
        threading.Event().wait(0.05)  # what the kernel alone tells


def test_a_download_ends_with_its_browser(page):
    def is_read():
        files = Path(f"/proc/{page.pid}/fd").iterdir()
        return any("large" in os.path.realpath(file) for file in files)

    connection = sent(page, "view", "GET", "/recordings/large")
    until(is_read)
    connection.close()
    until(lambda: not is_read())


def test_a_diagnosis_ends_with_its_browser(page):
    key = "long/d.model.yaml"
    keys = {"recording": "long", "model": "d.model.yaml"}
    # what another test has begun with this token may still end
    until(lambda: ask(page, "view", "/workbench/open", keys).status == 200)
    before = family(page.pid)
    assert ask(page, "view", f"/workbench/{key}/diagnosis", {}).status == 200
    until(lambda: family(page.pid) - before)
    (process,) = family(page.pid) - before
    with sent(page, "view", "GET", f"/workbench/{key}/diagnosis?follow"):
        pass
    until(lambda: process not in family(page.pid))
    answer = request(page.origin, "GET", f"/workbench/{key}/diagnosis", page.headers["view"])
    assert '"cancelled"' in answer.text
