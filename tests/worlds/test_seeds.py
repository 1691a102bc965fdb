"""Worlds from seeds: the fixed list holds, kept plans hold, and a seed gives the same bytes in two processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.worlds import command
from tests.worlds.command import Order, fixed_orders, main
from tests.worlds.compare import Row, compared
from tests.worlds.coverage import Coverage
from tests.worlds.known import known_worlds
from tests.worlds.plan import Plan
from tests.worlds.run import Report, play
from tests.worlds.watch import Finding

KEPT = sorted(Path(__file__).with_name("kept").glob("*.json"))
# Of a fixed seed; `make worlds` plays all of it.
PLAYED_S = 4.0
KNOWN_PLANS = {(known.plan, known.what) for known in known_worlds() if known.plan}


@pytest.mark.parametrize("order", fixed_orders()[:3], ids=lambda order: f"{order.rates}-{order.seed}")
def test_the_beginning_of_a_fixed_seed_holds(order: Order) -> None:
    plan = order.plan
    events = [event for event in plan.events if event.time_s < PLAYED_S]
    report = play(plan._replace(duration_s=PLAYED_S, events=tuple(events)))
    assert not report.findings
    assert report.setpoints > 0


@pytest.mark.parametrize("path", KEPT, ids=lambda path: path.stem)
def test_a_kept_plan_holds(path: Path) -> None:
    """One that fails for a known reason stands in known.yaml, and leaves it when it holds."""
    report = play(Plan.from_json(path.read_text(encoding="utf-8")))
    found = {finding.what for finding in report.findings}
    assert found == {what for plan, what in KNOWN_PLANS if plan == path.name}, report.findings


def test_every_known_plan_is_kept() -> None:
    assert {plan for plan, _ in KNOWN_PLANS} <= {path.name for path in KEPT}


def test_a_seed_gives_the_same_bytes_in_two_processes() -> None:
    repeat = [sys.executable, "-m", "tests.worlds", "--seed", "3", "--minutes", "0.05", "--shrink-for", "0"]
    lines = []
    for hash_seed in ("1", "2"):
        done = subprocess.run(
            repeat,
            capture_output=True,
            text=True,
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            check=False,
        )
        lines.append(done.stdout.splitlines()[-1])
    assert "sha256" in lines[0]
    assert lines[0] == lines[1]


def test_a_run_ends_with_one_line(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    assert main(["--seed", "1", "--minutes", "0.02", "--rates", "none", "--machine", "3-rps"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("1 seeds, 0.000 h, ")
    assert "everything held" in last


def test_rows_are_compared_by_state_and_by_numbers() -> None:
    row = Row(1, 0.5, "ok", (1.0, 2.0, float("nan")))
    assert compared(row, row._replace(numbers_mm=(1.0, 2.0 + 1e-10, float("nan")))) is None
    assert "differs by 1e-07 mm" in str(compared(row, row._replace(numbers_mm=(1.0, 2.0 + 1e-7, float("nan")))))
    assert "ok here, fault" in str(compared(row, row._replace(state="fault", numbers_mm=())))
    assert "ends earlier" in str(compared(row, None))


@pytest.mark.parametrize(
    ("options", "status"),
    [
        (["--seed", "5"], 1),
        (["--fresh-for", "0.001"], 0),
        (["--fresh-for", "0.001", "--fresh-fails"], 1),
    ],
)
def test_a_failure_fails_the_run_unless_its_seed_is_fresh(
    options: list[str],
    status: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    def fail(plan: Plan, **_: object) -> Report:
        finding = Finding("within_bound", "none", 0.1, "far away")
        return Report(plan, 1, "0", Coverage(), [finding], 0)

    monkeypatch.setattr(command, "play", fail)
    monkeypatch.setattr(command, "shrink", lambda plan, what, real_s: plan)
    assert main([*options, "--minutes", "0.01", "--machine", "linear-delta"]) == status
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith('make worlds OPTIONS="--seed ')
    assert said[-1].startswith("1 seeds, 0.000 h, 1 setpoints, ")
    assert said[-1].endswith("within_bound in 1 cases")
