"""Pages of other machines, of people with read-only tokens, and of a daemon that goes away."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from compd.client import connect
from compd.demo.processes import Command, run_commands
from compd.machine_kinds import KINDS, machine_text
from tests.support.live_page import opened, served, until

pytestmark = pytest.mark.long


def test_who_may_look_only_can_order_nothing_and_the_end_of_the_daemon_is_seen(chromium):
    with served("--read-only") as page, opened(chromium, page) as tab:
        until(tab, "document.getElementById('role').textContent === 'Orders: view only'")
        tab.keyboard.press("o")
        until(tab, "document.getElementById('arm').disabled")
        answer = tab.evaluate(
            "Promise.all([['arm', {id: compd.id}], ['orders/zero', {id: compd.id}], ['recordings', {name: 'a'}]].map("
            "([path, keys]) => fetch(path, {method: 'POST', body: JSON.stringify(keys)}).then((r) => r.status)))"
        )
        assert answer == [403, 403, 403]
        tab.keyboard.press("Escape")
        with connect(page.socket) as daemon:
            processes = daemon.status()["processes"]
        os.kill(processes["supervisor"]["pid"], signal.SIGTERM)
        until(tab, "document.body.dataset.state === 'gone'")
        assert tab.locator("#state").inner_text() == "NO DAEMON"
        assert tab.locator("#tip").inner_text() == "", "no number of what was"


def test_a_daemon_that_is_killed_and_started_again_is_found_again(chromium):
    with served() as page, opened(chromium, page) as tab:
        with connect(page.socket) as daemon:
            os.kill(daemon.status()["processes"]["supervisor"]["pid"], signal.SIGKILL)
        until(tab, "document.body.dataset.state === 'gone'")
        assert tab.locator("#tip").inner_text() == "", "no number of what was"
        configuration, socket = page.directory / "tripod-cmm.yaml", Path(page.socket)
        socket.unlink(missing_ok=True)
        with run_commands([Command(["run", str(configuration)], ready=socket)], log=page.directory / "again.log"):
            until(tab, "document.body.dataset.state === 'ok'")
            until(tab, "document.getElementById('tip').textContent.includes('mm')")


def test_a_hexapod_has_six_links(chromium):
    with served(name="hexapod.yaml") as page, opened(chromium, page) as tab:
        until(tab, "document.querySelectorAll('.strip .number b').length === 6")
        until(tab, "compd.live.scene && compd.live.scene.base.length === 6")
        tab.keyboard.press("6")
        assert tab.locator(".strip.selected").count() == 1


def test_what_a_machine_does_not_measure_is_listed_once(chromium, tmp_path):
    own = tmp_path / "delta.yaml"
    text = machine_text("delta", "linear-delta", KINDS["linear-delta"].usual)
    own.write_text(text.replace("limits: {", "limits: {tip_error_um: 3000, "))
    with served(name=str(own)) as page, opened(chromium, page) as tab:
        with connect(page.socket) as daemon:
            clauses = daemon.status()["not_measured"]
        assert len(clauses) == 3, "joints, frame, temperatures"
        until(tab, "document.querySelectorAll('#gauge-table .absent li').length === 3")
        shown = tab.locator("#gauge-table .absent li").all_inner_texts()
        assert shown == [f"Not measured: {clause}" for clause in clauses]
        if directory := os.environ.get("COMPD_PICTURES"):
            tab.locator("#gauges").screenshot(path=str(Path(directory) / "not-measured.png"))
