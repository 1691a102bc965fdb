"""One case from the sealed machine to the score, by the commands that a person would use."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml
from typer.testing import CliRunner

from compd.cli.main import app
from compd.configuration import load
from compd.recording.writer import write_recording
from compd.simulation.campaign.simulated_recording import simulate_recording
from compd.simulation.causes.hidden_cause import HiddenCause, write_answer
from tests.scoreboard.cases import Case
from tests.support.paths import ROOT

CONFIG = ROOT / "config" / "tripod-cmm.yaml"
TIMEOUT_S = 300.0


def prepare(case: Case, campaigns: Path) -> Path:
    """The case's two campaigns, made once: what is measured first, and other days on the same machine."""
    directory = campaigns / case.name.replace(":", "_")
    if not (directory / "other.answer.json").exists():
        directory.mkdir(parents=True, exist_ok=True)
        wanted = [HiddenCause(cause, None, size) for cause, size in zip(case.causes, case.floors, strict=True)]
        sized = hide(case, wanted, directory, "train", 0)
        hide(case, sized, directory, "other", 1)
    return directory


def run(case: Case, campaigns: Path) -> dict[str, Any]:
    """A line of the results: what was hidden, what the diagnosis said, and how well the model then does elsewhere."""
    prepared = prepare(case, campaigns)
    with tempfile.TemporaryDirectory(prefix="compd-score-") as temporary:
        directory = Path(temporary)
        for name in ("train.csv", "train.yaml", "other.csv", "other.yaml"):
            # without the seal: it stays where it is
            shutil.copy(prepared / name, directory)
        said, took_s = timed(directory, "diagnose", "train.csv", "--json")
        verdict = json.loads(said)
        ratio, fitted = add_all(directory, [step["effect"] for step in verdict["steps"]])
    secret = json.loads((prepared / "train.answer.json").read_text(encoding="utf-8"))
    return {
        "case": case.name,
        "kind": case.kind,
        "verdict": verdict,
        "took_s": took_s,
        "other_floor_ratio": ratio,
        "fitted": fitted,
        "secret": secret,
    }


def hide(case: Case, hidden: list[HiddenCause], directory: Path, name: str, other_days: int) -> list[HiddenCause]:
    """A campaign with these causes in it, and how strong each became; NAME.answer.json is for the scorer."""
    recorded = simulate_recording(load(CONFIG), case.seed, hidden, other_days=other_days)
    write_recording(directory / f"{name}.csv", recorded.columns, recorded.sidecar, overwrite=True)
    write_answer(directory / f"{name}.answer.json", recorded.hidden, recorded.weak, case.seed)
    return [HiddenCause(one.cause.id, one.cause.strength) for one in recorded.hidden]


def add_all(directory: Path, effects: list[str]) -> tuple[float, list[dict[str, Any]]]:
    """Floor ratio on the other days with the named effects in the model, and the numbers that were fitted."""
    model = directory / "model.yaml"
    given = ["--model", str(model)] if effects else []
    for effect in effects:
        at_once("effect", "add", effect, "--recording", str(directory / "train.csv"), *given)
    compared = json.loads(at_once("compare", str(directory / "other.csv"), "--json", *given))
    fitted = yaml.safe_load(model.read_text(encoding="utf-8"))["effects"] if effects else []
    return float(compared["floor_ratio"]), fitted


def at_once(*arguments: str) -> str:
    """What one command prints, in this process: hundreds of starts would cost more than the work.

    Raises RuntimeError, with its own words, where it fails.
    """
    done = CliRunner().invoke(app, arguments)
    if done.exit_code:
        raise RuntimeError(f"compd {' '.join(arguments)}: {done.output}") from done.exception
    return done.stdout


def timed(directory: Path, *arguments: str) -> tuple[str, float]:
    """What one command prints, and how many seconds it takes from start to end, as a person waits for it.

    Raises RuntimeError as `at_once` does.
    """
    # one thread each: cases run side by side
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    start_s = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "compd", *arguments],
        cwd=directory,
        env=environment,
        timeout=TIMEOUT_S,
        capture_output=True,
        text=True,
        check=False,
    )
    took_s = time.perf_counter() - start_s
    if done.returncode:
        raise RuntimeError(f"compd {' '.join(arguments)}: {done.stderr or done.stdout}")
    return done.stdout, took_s
