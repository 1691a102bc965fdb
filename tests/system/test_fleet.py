"""A fleet on a real cluster: scheduler and workers are processes of their own, recordings are broken, workers die."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from distributed import Client

from compd.errors import CompdError
from compd.fleet import RecordingResult, examination, examine_fleet, find_recordings, read_table, write_table
from compd.fleet.cluster import open_cluster
from compd.fleet.engine import outcomes
from tests.support.dask_cluster import DaskCluster, dask_cluster
from tests.support.measured import gauges, hidden, record
from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S

# Processes are started anew, and each imports compd.
RECORDINGS = 8


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with good recordings and a broken one."""
    directory = tmp_path_factory.mktemp("fleet")
    first = record(directory, gauges(90, 1), [hidden("link_expansion", 1.1)], name="run0")
    for ending in (".csv", ".yaml"):
        (directory / f"blank{ending}").unlink()
        for number in range(1, RECORDINGS):
            shutil.copy(first.with_suffix(ending), directory / f"run{number}{ending}")
    (directory / "run3.csv").write_text("time_s,scale_1_mm\n0,nothing\n")
    return directory


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[DaskCluster]:
    with dask_cluster(tmp_path, workers=2) as running:
        with Client(running.address, set_as_default=False) as client:
            client.wait_for_workers(2, PATIENCE_S)
        yield running


@pytest.mark.long
@pytest.mark.sample
def test_a_command_on_a_cluster_of_processes(fleet: Path, cluster: DaskCluster, tmp_path: Path) -> None:
    command = ["fleet", "compare", str(fleet), "--scheduler", cluster.address, "--html", "fleet.html"]
    done = subprocess.run(
        [sys.executable, "-m", "compd", *command],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    assert "7 recordings of 1 machine examined; 1 other could not be." in done.stdout
    results = read_table(tmp_path / "fleet.parquet")
    assert len(results) == RECORDINGS
    (failed,) = [result for result in results if result.problem]
    assert Path(failed.recording).name == "run3.csv"
    assert failed.machine == "tripod-cmm"
    assert len({result.rms_before_um for result in results if not result.problem}) == 1
    assert "run3.csv" in (tmp_path / "fleet.html").read_text(encoding="utf-8")


@pytest.mark.long
def test_a_worker_that_is_killed_in_the_middle_costs_no_recording(fleet: Path, cluster: DaskCluster) -> None:
    done: list[RecordingResult] = []

    def progress(result: RecordingResult) -> None:
        if not done:
            cluster.kill_worker()
        done.append(result)

    run = examine_fleet(examination("compare"), find_recordings([fleet]).recordings, cluster.address, progress)
    assert len(done) == RECORDINGS
    assert [Path(result.recording).name for result in run.results if result.problem] == ["run3.csv"]


@pytest.mark.long
def test_a_scheduler_that_ends_leaves_a_result_for_every_recording(
    fleet: Path, cluster: DaskCluster, capfd: pytest.CaptureFixture[str]
) -> None:
    def progress(result: RecordingResult) -> None:
        cluster.kill_scheduler()

    run = examine_fleet(examination("compare"), find_recordings([fleet]).recordings, cluster.address, progress)
    lost = [result for result in run.results if "the scheduler has ended" in result.problem]
    assert len(run.results) == RECORDINGS
    assert lost
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.long
def test_ctrl_c_leaves_a_result_for_every_recording(fleet: Path, cluster: DaskCluster) -> None:
    def interrupt(result: RecordingResult) -> None:
        raise KeyboardInterrupt

    run = examine_fleet(examination("compare"), find_recordings([fleet]).recordings, cluster.address, interrupt)
    assert run.interrupted
    problems = [result.problem for result in run.results]
    assert len(problems) == RECORDINGS
    assert sum("Ctrl-C ended the work" in problem for problem in problems) == RECORDINGS - 1


@pytest.mark.long
def test_a_run_goes_on_where_it_was_interrupted(fleet: Path, cluster: DaskCluster, tmp_path: Path) -> None:
    directory = tmp_path / "data"
    shutil.copytree(fleet, directory)
    done: list[RecordingResult] = []

    def interrupt(result: RecordingResult) -> None:
        done.append(result)
        if len(done) == 3:
            raise KeyboardInterrupt

    wanted = examination("compare")
    first = examine_fleet(wanted, find_recordings([directory]).recordings, cluster.address, interrupt)
    write_table(tmp_path / "fleet.parquet", first.results)
    kept = [result.recording for result in first.results if not result.problem]
    assert 2 <= len(kept) <= 3

    (directory / "run8.csv").write_bytes((directory / "run0.csv").read_bytes())
    (directory / "run8.yaml").write_bytes((directory / "run0.yaml").read_bytes())
    Path(kept[0]).unlink()
    changed = Path(kept[1]).with_suffix(".yaml")
    changed.write_text(changed.read_text() + "notes: seen again\n")
    second = examine_fleet(
        wanted,
        find_recordings([directory]).recordings,
        cluster.address,
        earlier=read_table(tmp_path / "fleet.parquet"),
    )
    assert second.kept == len(kept) - 2
    examined = [Path(result.recording).name for result in second.results if not result.problem]
    assert examined == [f"run{k}.csv" for k in range(9) if f"run{k}.csv" not in ("run3.csv", Path(kept[0]).name)]

    # nothing is left to be done, so that no cluster is needed
    (directory / "run3.csv").unlink()
    third = examine_fleet(wanted, find_recordings([directory]).recordings, "tcp://127.0.0.1:1", earlier=second.results)
    assert third.kept == len(third.results) == len(examined)


def test_recordings_that_a_worker_does_not_see(cluster: DaskCluster, tmp_path: Path) -> None:
    with (
        pytest.raises(CompdError, match="does not see a file"),
        open_cluster(cluster.address, [tmp_path / "nowhere.csv"]),
    ):
        pytest.fail("the cluster was opened")


def kills_at(deadly: int, number: int) -> int:
    """The square; of one number it ends the process."""
    if number == deadly:
        os._exit(9)
    if number < 0:
        raise ValueError("is negative")
    return number**2


@pytest.mark.long
@pytest.mark.sample
def test_an_item_that_kills_its_worker_is_one_outcome() -> None:
    items = [*range(20), -1]
    with open_cluster(processes=1) as client:
        found = {outcome.item: outcome for outcome in outcomes(client, partial(kills_at, 2), items, batch=4)}
    assert {item: outcome.result for item, outcome in found.items() if outcome.error is None} == {
        item: item**2 for item in items if item not in (2, -1)
    }
    assert isinstance(found[2].error, CompdError)
    assert "died" in str(found[2].error)
    assert isinstance(found[-1].error, ValueError)
