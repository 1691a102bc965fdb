"""The Debian package that `make deb` has built, in a container of its release: installed, upgraded, removed, purged.

The times that are printed (`make service`) are this computer's.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from compd.errors import DaemonError
from tests.support.container import Container, booted, debian, what_is_missing
from tests.support.installed_service import (
    CONFIGURATIONS,
    MACHINE,
    PATIENCE_S,
    Service,
    changed_limit,
    simulate,
    take_zero,
    without_s,
)
from tests.support.paths import CONFIG, ROOT

PROGRAM = Path("/usr/bin/compd")
STATE = Path("/var/lib/compd/machine-zero.json")
PACKAGES = Path("/opt/packages")
EXAMPLES = Path("/usr/share/doc/compd/examples")
# Longest pause of valid setpoints while another version takes over, s.
PAUSE_S = 2.0
# Releases of Debian by the number in the package's version.
RELEASES = {"12": "bookworm", "13": "trixie"}

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(900),
    pytest.mark.skipif(bool(what_is_missing()), reason=what_is_missing()),
]


@dataclass(frozen=True)
class PackagedService(Service):
    """The daemon of a package, for a simulated machine."""

    def install(self, package: str) -> str:
        """Install one of PACKAGES; what that prints."""
        return self.container.run("sh", "-c", f"dpkg --install {PACKAGES}/{package} 2>&1")

    def version(self) -> str:
        return self.container.run("dpkg-query", "--show", "--showformat=${Version}", "compd")


@pytest.fixture(scope="module", params=RELEASES)
def container(request: pytest.FixtureRequest) -> Iterator[Container]:
    """A booted Debian with the newest package for it in PACKAGES, and the same one as two later versions."""
    built = sorted((ROOT / "dist").glob(f"compd_*+deb{request.param}_*.deb"), key=lambda path: path.stat().st_mtime)
    if not built:
        pytest.skip(f"dist/ has no package for Debian {request.param}; `make deb` builds it")
    with tempfile.TemporaryDirectory(prefix="compd-deb-") as name:
        directory = Path(name)
        packages, root = directory / "packages", directory / "root"
        packages.mkdir()
        shutil.copy(built[-1], packages / "first.deb")
        make_later_versions(built[-1], directory / "unpacked", packages)
        subprocess.run(["cp", "-a", debian(RELEASES[request.param]), root], check=True)
        directory.chmod(0o755)
        with booted({packages: PACKAGES, CONFIG: CONFIGURATIONS}, root) as container:
            yield container


def make_later_versions(package: Path, directory: Path, packages: Path) -> None:
    subprocess.run(["dpkg-deb", "--raw-extract", package, directory], check=True)
    control = directory / "DEBIAN" / "control"
    text = control.read_text()
    for name in ("second", "third"):
        text = re.sub(r"(?m)^(Version: .+)$", r"\1+later", text)
        control.write_text(text)
        built = packages / f"{name}.deb"
        subprocess.run(["dpkg-deb", "-Znone", "--build", directory, built], check=True, stdout=subprocess.DEVNULL)


def test_a_machine_lives_with_the_package(container: Container) -> None:
    service = PackagedService(container)
    service.install("first.deb")
    assert not container.run("systemctl", "is-enabled", "compd", "compd-page", check=False).count("enabled")
    assert service.shown("ActiveState") == "inactive", "there is no configuration"
    what_belongs_to_the_system(container)
    what_everybody_may_do(container)

    simulate(container, PROGRAM)
    service.systemctl("start", "compd")
    take_zero(container, PROGRAM)
    service.wait_for_ok()
    zero, main = service.zero(), service.shown("MainPID")

    with controlled(service) as times_s:
        said = service.install("second.deb")
        service.wait_for_another_process(main)
        service.wait_for_ok()
    pause_s = max(after_s - before_s for before_s, after_s in pairwise(times_s))
    print(f"upgrade: {pause_s:.2f} s without setpoints for a controller, {without_s(said):.2f} s as it says")
    assert pause_s <= PAUSE_S
    assert service.version().endswith("+later")
    assert service.zero() == zero

    main = service.shown("MainPID")
    with changed_limit(service, "slew_mm_per_s", -1):
        said = service.install("third.deb")
    assert "slew_mm_per_s" in said, "the new version refuses the configuration"
    assert service.version().endswith("+later+later")
    assert service.shown("MainPID") == main, "and the daemon goes on"
    service.wait_for_ok()
    service.systemctl("restart", "compd")
    service.wait_for_ok()
    assert service.zero() == zero, "as the configuration is mended"

    container.run("dpkg", "--remove", "compd")
    assert container.run("systemctl", "is-active", "compd", check=False) == "inactive\n"
    assert not container.path("/usr/lib/compd").exists()
    assert container.path(STATE).exists()
    assert container.path(MACHINE).exists()

    service.install("first.deb")
    said = container.run("sh", "-ec", f"cd /; {PROGRAM} service install {MACHINE}")
    assert "systemctl enable --now compd compd-page" in said
    assert "sysusers" not in said
    assert " is complete: " in said, "what the check of the configuration says"
    service.wait_for_ok()
    assert service.zero() == zero, "the state has been kept"
    assert container.run("systemctl", "is-active", "compd", "compd-page") == "active\nactive\n"

    container.run("dpkg", "--purge", "compd")
    for path in ("/etc/compd", "/var/lib/compd", "/var/lib/compd-page", "/var/cache/compd", "/usr/lib/compd"):
        assert not container.path(path).exists(), path
    assert not container.run("find", "/etc/systemd", "-name", "compd*")


def what_belongs_to_the_system(container: Container) -> None:
    """Users, rule, manual pages and completions are where the system looks for them."""
    run = container.run
    assert run("dpkg", "--audit") == ""
    assert run("dpkg", "--verify", "compd") == ""
    assert "dialout" in run("id", "compd")
    assert "(compd)" in run("id", "compd-page")
    assert container.path("/usr/lib/udev/rules.d/70-compd.rules").exists()
    for page in ("compd.1.gz", "compd-service-install.1.gz"):
        assert container.path(f"/usr/share/man/man1/{page}").exists()
    completed = ". /usr/share/bash-completion/completions/compd; COMP_WORDS=(compd servi) COMP_CWORD=1"
    assert run("bash", "-c", f'{completed}; _compd_completion compd; echo "$COMPREPLY"') == "service\n"
    assert container.path("/usr/share/zsh/vendor-completions/_compd").read_text().startswith("#compdef compd\n")
    units = [f"/usr/lib/systemd/system/{unit}.service" for unit in ("compd", "compd-page")]
    assert run("systemd-analyze", "verify", "--man=no", *units) == ""


def what_everybody_may_do(container: Container) -> None:
    """A user without a home reads, checks and compares; nothing is compiled for that."""
    for command, expected in (
        ("--version", "compd "),
        (f"check {EXAMPLES}/tripod-cmm.yaml", " is complete: "),
        ("docs --path", "/documentation/index.html"),
    ):
        user = ("setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", "--reset-env", "--")
        assert expected in container.run(*user, str(PROGRAM), *command.split()), command


@contextmanager
def controlled(service: Service) -> Iterator[list[float]]:
    """A controller of a machine that stands still, which connects again whenever the daemon has gone.

    The times of the setpoints that answer it, s; after the block the last one is the end of the block.
    """
    times_s: list[float] = []
    end, answered = threading.Event(), threading.Event()

    def control() -> None:
        while not end.is_set():
            try:
                with service.connect() as client:
                    for setpoint in client.watch():
                        if setpoint["valid"]:
                            client.target(tip_B0_mm=setpoint["tip_B0_mm"])
                            if setpoint["mode"] == "machine_tool":
                                times_s.append(setpoint["time_s"])
                                answered.set()
                        if end.is_set():
                            break
            except DaemonError:
                end.wait(0.01)

    thread = threading.Thread(target=control)
    thread.start()
    try:
        assert answered.wait(PATIENCE_S)
        yield times_s
    finally:
        end.set()
        thread.join()
        times_s.append(time.monotonic())
