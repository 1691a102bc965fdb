"""The shipped units under a real systemd, in a container: what they promise on a machine whose gauges are simulated.

The times that are printed (`make service`) are this computer's.
"""

from __future__ import annotations

import json
import re
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.support.container import COMPD, booted, install_compd, wait_until, what_is_missing
from tests.support.installed_service import (
    CONFIGURATIONS,
    MACHINE,
    SOCKET,
    Service,
    changed_limit,
    simulate,
    take_zero,
    without_s,
)
from tests.support.paths import CONFIG, ROOT
from tests.support.patience import PATIENCE_S

UNITS = Path("/opt/systemd")
# Another environment beside COMPD.
NEXT = Path("/opt/compd-next")
TOKENS = Path("/etc/compd/page-tokens.yaml")
OF_THE_PAGE = Path("/var/lib/compd-page")

MAX_EXPOSURE = 2.0
# After a stop that takes longer a person wonders whether it hangs.
STOP_S = 2.0
# The first start compiles kernels.
FIRST_START_S = 300.0

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(900),
    pytest.mark.skipif(bool(what_is_missing()), reason=what_is_missing()),
]


@pytest.fixture(scope="module")
def installed() -> Iterator[Service]:
    """The daemon, installed by `compd service install`, and with machine zero taken."""
    with tempfile.TemporaryDirectory(prefix="compd-opt-") as directory:
        read_only = {**install_compd(Path(directory)), ROOT / "systemd": UNITS, CONFIG: CONFIGURATIONS}
        with booted(read_only) as container:
            # the interpreter may be linked with a library of its own
            container.path("/etc/ld.so.conf.d/python.conf").write_text("/opt/python/lib\n")
            container.run("ldconfig")
            container.run("systemd-sysusers", str(UNITS / "compd.sysusers"))
            simulate(container, COMPD / "bin" / "compd")
            try:
                container.run("sh", "-ec", f"cd /; {COMPD}/bin/compd service install {MACHINE} --no-page")
                take_zero(container, COMPD / "bin" / "compd")
            except AssertionError as error:
                raise AssertionError(container.run("journalctl", "--unit=compd", "--no-pager", check=False)) from error
            yield Service(container)


@pytest.fixture
def service(installed: Service) -> Service:
    """The unit, active, with the shipped limits, its setpoints ok, no restart counted."""
    installed.systemctl("reset-failed", "compd")
    installed.systemctl("start", "compd")
    installed.wait_for_ok()
    return installed


def report(what: str, **times_s: float) -> None:
    print(f"{what}: " + ", ".join(f"{name.replace('_', ' ')} {time_s:.2f} s" for name, time_s in times_s.items()))


def report_return(what: str, service: Service, from_s: float, ok_s: float) -> None:
    """Print what the return of the daemon consists of. from_s : when it was killed or stopped."""
    started_s, ready_s = service.reached_s("ExecMainStart"), service.reached_s("ActiveEnter")
    report(
        f"{what}, ok again after {ok_s - from_s:.2f} s",
        until_systemd_starts_it=started_s - from_s,
        until_READY=ready_s - started_s,
        until_ok=ok_s - ready_s,
    )


def test_the_unit_is_active_and_its_setpoints_are_ok(service: Service) -> None:
    assert service.shown("ActiveState") == "active"
    assert service.shown("SubState") == "running"
    watch = (f"{COMPD}/bin/compd", "watch", "--daemon", str(SOCKET), "--count=3", "--json")
    wait_until(lambda: '"state": "ok"' in service.container.run(*watch), "setpoints that are ok", PATIENCE_S)
    print("\n".join(re.findall(r"(?m)event=granted what.*|event=\"not permitted\".*", service.log())))


def test_exposure_is_at_most_two(service: Service) -> None:
    last = service.container.run("systemd-analyze", "security", "--no-pager", "compd").splitlines()[-1]
    print(last)
    exposure = re.search(r"exposure level for compd.service: ([\d.]+)", last)
    assert exposure is not None, last
    assert float(exposure[1]) <= MAX_EXPOSURE


def test_a_killed_daemon_comes_back_with_its_machine_zero(service: Service) -> None:
    zero, main = service.zero(), service.shown("MainPID")
    assert zero["taken"]
    killed_s = time.monotonic()
    service.signal_main("SIGKILL")
    service.wait_for_another_process(main)
    ok_s = service.wait_for_ok()
    report_return("SIGKILL", service, killed_s, ok_s)
    assert service.zero() == zero


def test_a_daemon_that_hangs_is_restarted_by_the_watchdog(service: Service) -> None:
    zero, main = service.zero(), service.shown("MainPID")
    stopped_s = time.monotonic()
    service.signal_main("SIGSTOP")
    service.wait_for_another_process(main)
    ok_s = service.wait_for_ok()
    report_return("SIGSTOP", service, stopped_s, ok_s)
    assert "Watchdog timeout" in service.log()
    assert service.zero() == zero


def test_a_start_that_fails_is_tried_again_until_it_succeeds(service: Service) -> None:
    """systemd by itself gives up at the sixth start within ten seconds."""
    with changed_limit(service, "slew_mm_per_s", -1):
        with pytest.raises(AssertionError, match="journalctl"):
            service.systemctl("restart", "compd")
        wait_until(lambda: int(service.shown("NRestarts")) > 5, "starts", PATIENCE_S)
        assert service.shown("SubState") in ("start", "auto-restart")
    service.wait_for_ok()


def test_reload_takes_the_new_configuration_and_keeps_the_unit_active(service: Service) -> None:
    main, zero = service.shown("MainPID"), service.zero()
    before = service.config_hash()
    with changed_limit(service, "slew_mm_per_s", 0.4):
        reload_s = time.monotonic()
        service.systemctl("reload", "compd")
        wait_until(lambda: service.config_hash() != before, "the new configuration", PATIENCE_S)
        ok_s = service.wait_for_ok()
        report("reload", until_ok_with_the_new_configuration=ok_s - reload_s)
        assert service.shown("ActiveState") == "active"
        assert service.shown("MainPID") == main
        assert service.zero() == zero
    service.systemctl("reload", "compd")
    wait_until(lambda: service.config_hash() == before, "the first configuration", PATIENCE_S)


def test_reload_refuses_an_invalid_configuration_and_the_old_one_goes_on(service: Service) -> None:
    main = service.shown("MainPID")
    with service.connect() as client, changed_limit(service, "slew_mm_per_s", -1):
        setpoints = client.watch()
        reload_s = time.time()
        service.systemctl("reload", "compd")
        wait_until(lambda: "slew_mm_per_s" in service.log(reload_s), "the refusal in the log", PATIENCE_S)
        before_s = time.monotonic()
        after = next(setpoint for setpoint in setpoints if setpoint["time_s"] > before_s)
        assert after["state"] == "ok", "the same connection, the same daemon"
        assert service.config_hash() == client.version["config_hash"]
        assert service.shown("ActiveState") == "active"
        assert service.shown("MainPID") == main


def test_stop_ends_at_once_and_by_itself(service: Service) -> None:
    started_s = time.monotonic()
    service.systemctl("stop", "compd")
    took_s = time.monotonic() - started_s
    report("systemctl stop", took=took_s)
    assert service.shown("Result") == "success"
    assert service.shown("ExecMainStatus") == "0"
    assert not service.container.path(SOCKET).exists()
    assert took_s <= STOP_S


@pytest.fixture
def next_release(service: Service) -> Iterator[Path]:
    """The program of another environment, as an upgrade has it; the first one runs again after the test."""
    run = service.container.run
    run("sh", "-ec", f"cp -a {COMPD} {NEXT} && sed -i s#{COMPD}/#{NEXT}/# {NEXT}/bin/compd")
    yield NEXT / "bin" / "compd"
    if str(NEXT) in service.shown("ExecStart"):
        run(f"{COMPD}/bin/compd", "service", "back")
    run("rm", "-r", str(NEXT))


def test_another_release_takes_over_and_gives_back(service: Service, next_release: Path) -> None:
    """Without the page, which is installed below."""
    zero = service.zero()
    upgraded = service.container.run(str(next_release), "service", "upgrade")
    assert str(NEXT) in service.shown("ExecStart")
    assert upgraded.count("ok, then ok") == 1
    assert service.zero() == zero
    back = service.container.run(str(next_release), "service", "back")
    assert str(COMPD) in service.shown("ExecStart")
    report("another release", upgrade=without_s(upgraded), back=without_s(back))


@dataclass(frozen=True)
class PageService:
    """The page as systemd runs it beside the daemon. token : of a person who may operate."""

    service: Service
    token: str

    def as_its_user(self, command: str, user: str = "compd-page") -> bool:
        """Whether a command of the shell succeeds in the page's mounts. user : that runs it, with its groups."""
        pid = self.service.systemctl("show", "--value", "--property=MainPID", "compd-page").strip()
        command = f"{command} >/dev/null 2>&1 && echo succeeded"
        entered = ("nsenter", f"--target={pid}", "--mount", "setpriv", f"--reuid={user}", f"--regid={user}")
        words = self.service.container.run(*entered, "--init-groups", "sh", "-c", command, check=False)
        return words == "succeeded\n"

    def asked(self, *requests: tuple[str, Any]) -> dict[str, Any]:
        """What a browser with the token gets: `state` of an event that is ok, and each request's status and answer."""
        words = self.service.container.run(
            f"{COMPD}/bin/python3", "-c", _BROWSER, self.token, json.dumps(requests), check=True
        )
        return dict(json.loads(words))


# What a browser does: the token becomes a cookie, the stream tells the connection's id, orders come from the page.
_BROWSER = """
import http.client, json, sys, time
token, requests = sys.argv[1], json.loads(sys.argv[2])

def ask(method, path, body=None, headers={}):
    connection = http.client.HTTPConnection("127.0.0.1", 7760, timeout=PATIENCE_S)
    connection.request(method, path, None if body is None else json.dumps(body), headers)
    return connection.getresponse()

entered = ask("GET", "/?token=" + token)
own = {"Cookie": entered.getheader("Set-Cookie", "").partition(";")[0], "Origin": "http://127.0.0.1:7760"}
stream = ask("GET", "/live", headers=own)
data = (json.loads(line[5:]) for line in stream if line.startswith(b"data:"))
id = next(data)["id"]
state = next(event for event in data if '"ok"' in json.dumps(event)) and "ok"
answers = []
for path, keys in requests:
    answer = ask("POST", path, {"id": id, **keys}, own)
    answers.append([answer.status, answer.read().decode()])
print(json.dumps({"state": state, "answers": answers}))
"""


@pytest.fixture(scope="module")
def installed_page(installed: Service) -> PageService:
    """The page, installed beside the daemon, with one token."""
    container = installed.container
    container.run("sh", "-ec", f"cd /; {COMPD}/bin/compd service install {MACHINE}")
    added = container.run("sh", "-ec", f"cd /; {COMPD}/bin/compd page --tokens {TOKENS} --new-token operate:anna")
    installed.systemctl("restart", "compd-page")
    return PageService(installed, added.strip())


@pytest.fixture
def page(service: Service, installed_page: PageService) -> PageService:
    """The page, active and listening, beside a daemon that is ok."""
    service.systemctl("start", "compd-page")

    def answers() -> bool:
        script = "import http.client as h; c = h.HTTPConnection('127.0.0.1', 7760); c.request('GET', '/')"
        return "no" not in service.container.run(
            "sh", "-c", f'{COMPD}/bin/python3 -c "{script}" || echo no', check=False
        )

    try:
        wait_until(answers, "the page", FIRST_START_S)
    except AssertionError as error:
        raise AssertionError(page_log(service)) from error
    return installed_page


def page_log(service: Service) -> str:
    return service.container.run("journalctl", "--unit=compd-page", "--output=cat", "--no-pager", check=False)


def test_the_page_has_a_user_of_its_own_that_reaches_the_socket_and_nothing_else(page: PageService) -> None:
    run, daemon = page.service.container.run, page.service
    pid = daemon.systemctl("show", "--value", "--property=MainPID", "compd-page").strip()
    assert run("ps", "-o", "user=", "-p", pid).startswith("compd-pa")
    assert run("ps", "-o", "user=", "-p", daemon.shown("MainPID")).strip() == "compd"
    assert page.as_its_user(f"test -w {SOCKET}")
    assert page.as_its_user(f"cat {TOKENS}"), "root has added a token, and the file is still the page's"
    for path in ("/etc/shadow", "/var/lib/compd", "/var/lib/compd/machine-zero.json", "/var/cache/compd"):
        assert run("ls", path).strip()
        assert not page.as_its_user(f"cat {path} || ls {path}/"), path
    for place in ("/", "/etc", "/etc/compd", "/opt", "/run", "/run/compd", "/var", "/var/lib", "/usr", "/dev", "/home"):
        assert not page.as_its_user(f"touch {place}/x"), place
    assert not page.as_its_user(f"touch {TOKENS}"), "it gives nobody a token"
    for place in (OF_THE_PAGE, OF_THE_PAGE / "recordings", OF_THE_PAGE / "models", "/var/cache/compd-page", "/tmp"):
        assert page.as_its_user(f"touch {place}/x && rm {place}/x"), place
    assert not page.as_its_user("ls /dev/ttyS* || ls /dev/kmsg || ls /dev/cpu_dma_latency"), "no devices"
    assert not page.as_its_user(f"ls {OF_THE_PAGE}", user="compd"), "the daemon reads nothing of the page's"


def test_a_browser_with_a_token_sees_arms_and_orders_and_the_page_records(page: PageService) -> None:
    name = "from-the-page"
    said = page.asked(
        ("/orders/zero", {"subject": "replace"}),
        ("/arm", {}),
        ("/orders/zero", {"subject": "replace"}),
        ("/recordings", {"name": name}),
    )
    assert said["state"] == "ok"
    assert [status for status, _ in said["answers"]] == [403, 200, 200, 200], said
    recordings = page.service.container.path(OF_THE_PAGE / "recordings")
    wait_until(lambda: list(recordings.glob(f"{name}*")), "a recording", PATIENCE_S)
    page.asked(("/recordings", {"stop": True}))
    assert all(file.stat().st_mode & 0o077 == 0 for file in recordings.glob(f"{name}*"))
    assert page.token not in page_log(page.service) + page.service.log()


def test_a_model_of_the_page_goes_to_the_daemon_by_an_open_descriptor(page: PageService) -> None:
    """The daemon may not read the file: it gets it opened."""
    model = OF_THE_PAGE / "models" / "page.model.yaml"
    words = "format: 2\\nmachine: tripod-cmm\\neffects: []\\n"
    assert page.as_its_user(f"umask 077; printf '{words}' > {model}; cat {model}")
    assert not page.as_its_user(f"cat {model}", user="compd")
    said = page.asked(("/arm", {}), ("/orders/shadow", {"subject": model.name}))
    assert [status for status, _ in said["answers"]] == [200, 200], said


def test_page_and_daemon_stop_and_start_alone(page: PageService) -> None:
    daemon = page.service
    main = daemon.shown("MainPID")
    daemon.systemctl("stop", "compd-page")
    assert daemon.shown("MainPID") == main
    assert daemon.systemctl("show", "--value", "--property=Result", "compd-page").strip() == "success"
    daemon.systemctl("start", "compd-page")
    daemon.systemctl("stop", "compd")
    assert daemon.systemctl("is-active", "compd-page").strip() == "active"


def test_the_pages_exposure_is_at_most_two(page: PageService) -> None:
    last = page.service.container.run("systemd-analyze", "security", "--no-pager", "compd-page").splitlines()[-1]
    exposure = re.search(r"exposure level for compd-page.service: ([\d.]+)", last)
    assert exposure is not None, last
    assert float(exposure[1]) <= MAX_EXPOSURE


def test_a_release_that_does_not_start_gives_way_to_the_one_before(service: Service, next_release: Path) -> None:
    """Its check of the configuration passes, and its daemon ends at once."""
    broken = "import sys\nif sys.argv[1] == 'run':\n    sys.exit(1)\n"
    program = service.container.path(next_release)
    shebang, rest = program.read_text().split("\n", 1)
    program.write_text(f"{shebang}\n{broken}{rest}")
    with pytest.raises(AssertionError, match="did not come as far"):
        service.container.run(str(next_release), "service", "upgrade")
    assert str(COMPD) in service.shown("ExecStart")
    service.wait_for_ok()
