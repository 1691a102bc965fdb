"""The computers that do the work: a running Dask cluster, or all cores of this computer."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from compd.errors import CompdError, Problem
from compd.extras import install_line
from compd.release import __version__

if TYPE_CHECKING:
    from distributed import Client

# Timeout (s) of connecting; a scheduler in the same building answers within milliseconds.
CONNECT_S = 10
# One thread each, also where a worker's own settings say otherwise: matrices are small, and there is a worker per core.
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def check_installed() -> None:
    """Raise CompdError if packages for fleets are missing."""
    try:
        import distributed  # noqa: F401
        import plotly  # noqa: F401
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise CompdError.of(
            "compd fleet", f"needs the package {error.name}, which is not installed", next_step=install_line("fleet")
        ) from error


@contextmanager
def open_cluster(
    scheduler: str | None = None, paths: Sequence[Path] = (), processes: int | None = None
) -> Iterator[Client]:
    """A client of a cluster, for the duration of the block.

    Parameters
    ----------
    scheduler : str, optional
        Address of a scheduler that runs already, ``"tcp://host:port"``; left out, a worker process for each core of
        this computer is started, and ended with the block.
    paths : sequence of Path
        Files that the workers must be able to read.
    processes : int, optional
        Worker processes of this computer; left out, one for each core.

    Raises
    ------
    CompdError
        Where Dask is not installed; where the scheduler does not answer, or has no worker; where a worker lacks compd,
        has another release, or does not see the files.
    """
    check_installed()
    if scheduler is None:
        with _local(processes or len(os.sched_getaffinity(0))) as client:
            yield client
    else:
        with _connected(scheduler) as client:
            check_workers(client, scheduler, paths)
            yield client


@contextmanager
def _local(processes: int) -> Iterator[Client]:
    import dask
    from distributed import Client, LocalCluster, WorkerPlugin

    class WithoutCtrlC(WorkerPlugin):
        """Ctrl-C reaches every process of a terminal; this one alone is to end the others."""

        def setup(self, worker: object) -> None:
            signal.signal(signal.SIGINT, signal.SIG_IGN)

    settings: Mapping[str, Any] = {
        # a worker that died is known at once; the engine tries its item again
        "distributed.scheduler.allowed-failures": 0,
        "distributed.nanny.pre-spawn-environ": _ONE_THREAD,
        # these monitors are unused, and take a tenth of each processor
        "distributed.worker.profile.enabled": False,
        "distributed.admin.system-monitor.interval": "5s",
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.tick.limit": "60s",
    }
    with (
        dask.config.set(settings),
        LocalCluster(
            n_workers=processes,
            threads_per_worker=1,
            # no dashboard, and none of the ports that another cluster may have
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
            # the fate of workers is reported as the outcome of an item
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        client.register_plugin(WithoutCtrlC())
        yield client


@contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    from distributed import Client
    from distributed.utils import silence_logging_cmgr

    try:
        client = Client(scheduler, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise CompdError.of(
            "--scheduler",
            "no Dask scheduler answers",
            value=scheduler,
            allowed="tcp://HOST:PORT, as `dask scheduler` prints it",
            next_step="start one with `dask scheduler`, or leave it out: then this computer does the work",
        ) from error
    # a lost scheduler is reported as the outcome of an item, too
    with silence_logging_cmgr(logging.CRITICAL), client:
        yield client


def check_workers(client: Client, scheduler: str, paths: Sequence[Path] = ()) -> None:
    """Raise CompdError for a cluster without workers, or for workers that cannot do the work, with all of them.

    paths : files that the workers must be able to read.
    """
    # functions of the standard library: any worker has them
    releases = client.run(version, "compd", on_error="return")
    if not releases:
        raise CompdError.of(
            scheduler,
            "the scheduler has no worker",
            next_step=f"start one on each computer: `dask worker {scheduler} --nworkers auto --nthreads 1`",
        )
    problems = [
        Problem(
            f"worker {worker}",
            "has no compd"
            if isinstance(release, PackageNotFoundError)
            else "has another release of compd than this computer",
            value="" if isinstance(release, Exception) else str(release),
            allowed=__version__,
            next_step=f"there: python -m pip install 'compd[fleet]=={__version__}', and start the worker again",
        )
        for worker, release in releases.items()
        if release != __version__
    ]
    for path in paths:
        problems += [
            Problem(
                f"worker {worker}",
                "does not see a file",
                value=str(path),
                next_step="put recordings, configurations and models where all computers have them under one name",
            )
            for worker, is_there in client.run(os.path.exists, str(path)).items()
            if not is_there
        ]
    if problems:
        raise CompdError(problems)
