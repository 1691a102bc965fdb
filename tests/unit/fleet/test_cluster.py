"""What is said of a cluster that cannot do the work, before any work begins."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest

from compd.errors import CompdError
from compd.fleet.cluster import check_installed, check_workers, open_cluster
from compd.release import __version__

ADDRESS = "tcp://lab:8786"


class Workers:
    """A client of workers that have these releases of compd, and see these files."""

    def __init__(self, releases: dict[str, Any], files: frozenset[str] = frozenset()) -> None:
        self.releases = releases
        self.files = files

    def run(self, function: Callable[..., Any], argument: str, **_: Any) -> dict[str, Any]:
        if argument == "compd":
            return self.releases
        return dict.fromkeys(self.releases, argument in self.files)


def problems(workers: Workers, *paths: Path) -> list[str]:
    with pytest.raises(CompdError) as caught:
        check_workers(workers, ADDRESS, paths)  # type: ignore[arg-type]
    return [f"{problem.where} {problem.what}" for problem in caught.value.problems]


def test_a_cluster_that_can_do_the_work() -> None:
    check_workers(Workers({"tcp://a:1": __version__}, frozenset({"/data/run.csv"})), ADDRESS, [Path("/data/run.csv")])  # type: ignore[arg-type]


def test_every_worker_that_cannot_is_named() -> None:
    workers = Workers({"tcp://a:1": __version__, "tcp://b:1": "0.1.0", "tcp://c:1": PackageNotFoundError("compd")})
    assert problems(workers) == [
        "worker tcp://b:1 has another release of compd than this computer",
        "worker tcp://c:1 has no compd",
    ]


def test_no_worker() -> None:
    assert problems(Workers({})) == [f"{ADDRESS} the scheduler has no worker"]


def test_workers_that_do_not_see_the_recordings() -> None:
    assert problems(Workers({"tcp://a:1": __version__}), Path("/data/run.csv")) == [
        "worker tcp://a:1 does not see a file"
    ]


def test_packages_that_are_missing_are_named_with_what_installs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(CompdError, match=r"pyarrow, which is not installed\n.*compd\[fleet\]"):
        check_installed()


def test_an_address_that_is_none() -> None:
    with pytest.raises(CompdError, match="no Dask scheduler answers"), open_cluster("lab"):
        pytest.fail("the cluster was opened")
