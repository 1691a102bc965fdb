"""One case of the scoreboard: campaigns with hidden causes, then the commands that a user would run."""

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
    """Directory of the case's two campaigns, on the same machine on different days; made once."""
    directory = campaigns / case.name.replace(":", "_")
    if not (directory / "other.answer.json").exists():
        directory.mkdir(parents=True, exist_ok=True)
        wanted = [HiddenCause(cause, None, size) for cause, size in zip(case.causes, case.floors, strict=True)]
        sized = write_campaign(case, wanted, directory, "train", 0)
        write_campaign(case, sized, directory, "other", 1)
    return directory


def run(case: Case, campaigns: Path) -> dict[str, Any]:
    """One result: what was hidden, the diagnosis, and the floor ratio of its model on the other campaign."""
    prepared = prepare(case, campaigns)
    with tempfile.TemporaryDirectory(prefix="compd-score-") as temporary:
        directory = Path(temporary)
        for name in ("train.csv", "train.yaml", "other.csv", "other.yaml"):
            # the answer files are not copied
            shutil.copy(prepared / name, directory)
        output, took_s = run_timed(directory, "diagnose", "train.csv", "--json")
        verdict = json.loads(output)
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


def write_campaign(
    case: Case, hidden: list[HiddenCause], directory: Path, name: str, other_days: int
) -> list[HiddenCause]:
    """Write a campaign with these causes and its answer file; returns the causes with the strengths that they got."""
    recorded = simulate_recording(load(CONFIG), case.seed, hidden, other_days=other_days)
    write_recording(directory / f"{name}.csv", recorded.columns, recorded.sidecar, overwrite=True)
    write_answer(directory / f"{name}.answer.json", recorded.hidden, recorded.weak, case.seed)
    return [HiddenCause(sized.cause.id, sized.cause.strength) for sized in recorded.hidden]


def add_all(directory: Path, effects: list[str]) -> tuple[float, list[dict[str, Any]]]:
    """Floor ratio on the other campaign with these effects added to the model, and the fitted effects."""
    model = directory / "model.yaml"
    model_option = ["--model", str(model)] if effects else []
    for effect in effects:
        run_in_process("effect", "add", effect, "--recording", str(directory / "train.csv"), *model_option)
    compared = json.loads(run_in_process("compare", str(directory / "other.csv"), "--json", *model_option))
    fitted = yaml.safe_load(model.read_text(encoding="utf-8"))["effects"] if effects else []
    return float(compared["floor_ratio"]), fitted


def run_in_process(*arguments: str) -> str:
    """Output of a command, run in this process to save its start. Raises RuntimeError with the output if it fails."""
    done = CliRunner().invoke(app, arguments)
    if done.exit_code:
        raise RuntimeError(f"compd {' '.join(arguments)}: {done.output}") from done.exception
    return done.stdout


def run_timed(directory: Path, *arguments: str) -> tuple[str, float]:
    """Output of a command in a process of its own, and its duration from start to end in seconds.

    Raises RuntimeError as `run_in_process` does.
    """
    # one thread each, because cases run side by side
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
