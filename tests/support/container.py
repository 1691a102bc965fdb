"""A container that systemd boots: Debian's minimal system, kept between runs, and compd installed in it as by pip.

What happens in the container is gone with it: the system below is only read. It has no network but its own loopback.
"""

from __future__ import annotations

import compileall
import os
import platform
import shutil
import signal
import socket
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from tests.support.paths import ROOT

# procps has the `kill` that every Debian has but the minimal one; python3 brings the libraries that the interpreter of
# this environment is linked with.
PACKAGES = ("systemd-sysv", "dbus", "procps", "python3")
PROGRAMS = ("debootstrap", "nsenter", "setpriv", "systemd-nspawn")

BOOT_TIMEOUT_S = 60.0
STOP_TIMEOUT_S = 20.0
LOOK_EVERY_S = 0.02

# The interpreter, the installed packages and compd, outside any home: the unit has ProtectHome=yes.
PYTHON, LIBRARIES, COMPD = Path("/opt/python"), Path("/opt/packages"), Path("/opt/compd")

T = TypeVar("T")


def what_is_missing() -> str:
    """Why no container can be booted here; "" where one can."""
    absent = [name for name in PROGRAMS if shutil.which(name) is None]
    if absent:
        return f"not installed: {', '.join(absent)} (apt-get install debootstrap systemd-container util-linux)"
    return "" if os.geteuid() == 0 else "a container is booted by root alone"


def wait_until(condition: Callable[[], T | None], what: str, timeout_s: float) -> T:
    """What `condition` returns, once it is neither None nor False; AssertionError after `timeout_s`."""
    end_s = time.monotonic() + timeout_s
    while True:
        result = condition()
        if result is not None and result is not False:
            return result
        assert time.monotonic() < end_s, f"waited {timeout_s:g} s for {what}"
        time.sleep(LOOK_EVERY_S)  # nothing inside the container tells the outside that something has changed


@dataclass(frozen=True)
class Container:
    """A running container. leader : the process id, outside, of its first process."""

    leader: int

    def run(self, *command: str, check: bool = True) -> str:
        """What a command prints inside, run by root. Raises AssertionError with its errors if it fails."""
        done = subprocess.run(
            ["nsenter", f"--target={self.leader}", "--all", "--wd=/", *command],
            capture_output=True,
            text=True,
            check=False,
            env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8", "SYSTEMD_PAGER": ""},
        )
        assert not check or done.returncode == 0, f"{' '.join(command)}: {done.stdout}{done.stderr}"
        return done.stdout

    def path(self, inside: str | Path) -> Path:
        """Where a file or socket of the container is found from outside."""
        return Path(f"/proc/{self.leader}/root") / Path(inside).relative_to("/")


@contextmanager
def booted(read_only: Mapping[Path, Path], root: Path | None = None) -> Iterator[Container]:
    """Boot a container in which `read_only` (outside -> inside) is mounted; it is gone after the block.

    It is also gone with this process, however that ends. root : its system, which it changes; `debian()` and only read
    where there is none.
    """
    system = [f"--directory={debian()}", "--volatile=overlay"] if root is None else [f"--directory={root}"]
    with tempfile.TemporaryDirectory(prefix="compd-container-") as directory:
        notified = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        address, log = Path(directory) / "notify", Path(directory) / "log"
        notified.bind(str(address))
        notified.settimeout(BOOT_TIMEOUT_S)
        with log.open("wb") as output:
            process = subprocess.Popen(
                [
                    *("setpriv", "--pdeathsig=TERM", "--"),
                    *("systemd-nspawn", "--quiet", "--boot", *system),
                    *(f"--machine=compd-test-{os.getpid()}", "--private-network", "--notify-ready=yes"),
                    # where systemd does not run outside, nobody makes a scope for the container
                    *("--register=no", *([] if Path("/run/systemd/system").is_dir() else ["--keep-unit"])),
                    *("--console=pipe", "--kill-signal=SIGRTMIN+3"),
                    # a container filters calls that a computer does not; whether they are granted is another question
                    "--system-call-filter=@memlock",
                    *(f"--bind-ro={outside}:{inside}" for outside, inside in read_only.items()),
                ],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                # the container has cgroups of the second version, whatever this computer has
                env={**os.environ, "NOTIFY_SOCKET": str(address), "SYSTEMD_NSPAWN_UNIFIED_HIERARCHY": "1"},
            )
        try:
            # closed after that: the container's systemd would wait for somebody to read what else it notifies
            with notified:
                leader = _leader(notified, process, log)
            yield Container(leader)
        finally:
            _end(process)


def _leader(notified: socket.socket, process: subprocess.Popen[bytes], log: Path) -> int:
    """The process id of the container's first process, once that says that it has booted."""
    leader = 0
    while True:
        try:
            lines = notified.recv(4096).decode().splitlines()
        except TimeoutError:
            state = "has ended" if process.poll() is not None else "is not ready"
            raise AssertionError(f"the container {state}: {log.read_text(errors='replace')}") from None
        for line in lines:
            if line.startswith("X_NSPAWN_LEADER_PID="):
                leader = int(line.partition("=")[2])
            if line == "READY=1" and leader:
                return leader


def _end(process: subprocess.Popen[bytes]) -> None:
    """Shut the container down, or end it: its processes are killed with systemd-nspawn."""
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def debian(release: str = "") -> Path:
    """The minimal system, made once. release : of Debian; this computer's where it is "".

    This environment's interpreter runs in this computer's release alone.
    """
    release = release or platform.freedesktop_os_release().get("VERSION_CODENAME", "bookworm")
    done = subprocess.run([ROOT / "debian" / "root", release, *PACKAGES], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-4000:]
    return Path(done.stdout.strip())


def install_compd(directory: Path) -> dict[Path, Path]:
    """Make, in `directory`, an environment with the checkout's compd; what a container has to mount for it.

    The interpreter and the packages that compd needs are this environment's own. In the container `/etc/ld.so.cache`
    has to be made anew, as after every installation of a library: `ldconfig`.
    """
    python = Path(os.path.realpath(sys.executable)).relative_to(sys.base_prefix)
    packages = directory / Path(sysconfig.get_path("purelib")).relative_to(sys.prefix)
    packages.mkdir(parents=True)
    for package in ("compd", "drivers/compd_drivers"):
        shutil.copytree(ROOT / package, packages / Path(package).name, ignore=shutil.ignore_patterns("__pycache__"))
    for directory_of, name in (("config", "shipped_config"), ("systemd", "shipped_systemd")):
        shutil.copytree(ROOT / directory_of, packages / "compd" / name)
    (packages / "other.pth").write_text(f"{LIBRARIES}\n")
    compileall.compile_dir(packages, quiet=1, stripdir=str(directory), prependdir=str(COMPD))
    programs = directory / "bin"
    programs.mkdir()
    (programs / "python3").symlink_to(PYTHON / python)
    (programs / "compd").write_text(f"#!{COMPD}/bin/python3\nfrom compd.cli import main\n\nmain()\n")
    (programs / "compd").chmod(0o755)
    (directory / "pyvenv.cfg").write_text(f"home = {(PYTHON / python).parent}\n")
    directory.chmod(0o755)
    return {
        Path(sys.base_prefix): PYTHON,
        Path(sysconfig.get_path("purelib")): LIBRARIES,
        directory: COMPD,
    }
