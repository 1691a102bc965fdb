"""Limits of a process under which the daemon cannot run: a sentence with the next step, before anything is loaded."""

from __future__ import annotations

import errno
import resource
import subprocess
import sys
from collections.abc import Callable

import pytest

from compd.errors import DaemonError
from compd.live.system.process_limits import exhaustion_named, require_descriptors, require_limits
from tests.support.paths import CONFIG

SMALL = {
    "400 MB of memory": (resource.RLIMIT_AS, 400_000_000, require_limits, "ulimit -v unlimited"),
    "700 MB of memory": (resource.RLIMIT_AS, 700_000_000, require_limits, "LimitAS=infinity"),
    "no file": (resource.RLIMIT_FSIZE, 0, require_limits, "ulimit -f unlimited"),
    "12 open files": (resource.RLIMIT_NOFILE, 12, lambda: require_descriptors(6), "ulimit -n 1024"),
    "24 open files": (resource.RLIMIT_NOFILE, 24, lambda: require_descriptors(6), "LimitNOFILE=1024"),
}
ENOUGH = {
    "1.2 GB of memory": (resource.RLIMIT_AS, 1_200_000_000, require_limits),
    "40 open files": (resource.RLIMIT_NOFILE, 40, lambda: require_descriptors(6)),
    "anything": (resource.RLIMIT_AS, resource.RLIM_INFINITY, require_limits),
}


def limited(monkeypatch: pytest.MonkeyPatch, number: int, allowed: int) -> None:
    unlimited = resource.RLIM_INFINITY
    monkeypatch.setattr(resource, "getrlimit", lambda asked: (allowed if asked == number else unlimited, unlimited))


@pytest.mark.parametrize("case", SMALL)
def test_a_limit_that_is_too_low_is_named_with_what_sets_it(monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    number, allowed, require, next_step = SMALL[case]
    limited(monkeypatch, number, allowed)
    with pytest.raises(DaemonError) as raised:
        require()
    (problem,) = raised.value.problems
    assert problem.value == str(allowed)
    assert next_step in problem.next_step


@pytest.mark.parametrize("case", ENOUGH)
def test_one_that_is_high_enough_is_not(monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    number, allowed, require = ENOUGH[case]
    limited(monkeypatch, number, allowed)
    require()


def raises(error: Exception) -> Callable[[], None]:
    def fail() -> None:
        raise error

    return fail


@pytest.mark.parametrize(
    "error",
    [MemoryError(), OSError(errno.EMFILE, "Too many open files"), RuntimeError("can't start new thread")],
    ids=["memory", "files", "threads"],
)
def test_what_is_used_up_later_is_named_too(error: Exception) -> None:
    with pytest.raises(DaemonError, match="are used up"), exhaustion_named():
        raises(error)()


def test_another_error_stays_what_it_is() -> None:
    with pytest.raises(FileNotFoundError), exhaustion_named():
        raises(FileNotFoundError(errno.ENOENT, "no such file"))()


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_the_daemon_says_so_in_place_of_a_traceback(name: str) -> None:
    command = f"ulimit -v 400000; exec {sys.executable} -m compd run {CONFIG / name}"
    ended = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "needs more bytes of memory than it may have" in ended.stderr + ended.stdout
    assert "Traceback" not in ended.stderr
