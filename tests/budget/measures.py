"""Counts of the source tree, and of what a running program loads of it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path

import typer
from grimp import build_graph

import compd
from compd.calibration.criteria import CalibrationCriteria
from compd.cli.commands import make_app
from compd.comparison import ComparisonCriteria
from compd.configuration import json_schema
from compd.diagnosis.criteria import Criteria
from compd.fleet.criteria import FleetCriteria
from compd.planning.planning_criteria import PlanningCriteria
from compd.recording.fault_criteria import FaultCriteria
from compd.threshold import thresholds
from tests.support.paths import ROOT
from tests.support.processes import Machine

PRODUCT = ROOT / "compd"
CRITERIA = (Criteria, ComparisonCriteria, FleetCriteria, CalibrationCriteria, FaultCriteria, PlanningCriteria)
# What the interpreter prints for each module that it imports, in every process, where this is set.
TRACE = {"PYTHONVERBOSE": "1"}
_TRACED = re.compile(r"^import '(compd[\w.]*)' #", re.MULTILINE)


def lines() -> int:
    """Lines of the package, comments and empty ones as well."""
    return sum(map(_lines, PRODUCT.rglob("*.py")))


def files() -> int:
    return sum(1 for _ in PRODUCT.rglob("*.py"))


def doors() -> int:
    """Modules of a package that a module outside of the package imports."""
    graph = build_graph("compd")
    inside = {module: _package(module) for module in graph.modules}
    edges = [(module, to) for module in inside for to in graph.find_modules_directly_imported_by(module)]
    return len({to for module, to in edges if inside[to] != inside[module] and inside[to] in inside})


def top_level_commands() -> int:
    """What `compd --help` lists."""
    return len(typer.main.get_group(make_app()).commands)


def configuration_keys() -> int:
    """Keys of the configuration, each of them once for each section that has it."""
    schema = json_schema()
    return sum(len(part.get("properties", ())) for part in [schema, *schema["$defs"].values()])


def threshold_numbers() -> int:
    return sum(len(thresholds(kind)) for kind in CRITERIA)


def runtime_dependencies() -> int:
    """Packages that come along without any extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return len(project["dependencies"])


def loaded_by_the_daemon() -> int:
    """Lines of the modules that the processes of `compd run` load until the tripod's setpoints are good."""
    with tempfile.TemporaryDirectory() as directory, Machine(Path(directory)) as machine:
        before = dict(os.environ)
        os.environ.update(TRACE)
        try:
            daemon = machine.daemon(machine.configuration("budget"))
        finally:
            os.environ.clear()
            os.environ.update(before)
        trace = daemon.log.read_text(encoding="utf-8", errors="replace")
    return _traced_lines(trace)


def loaded_by_diagnose() -> int:
    """Lines of the modules that `compd diagnose` loads for a campaign with a hidden cause."""
    with tempfile.TemporaryDirectory() as directory:
        recording = Path(directory) / "campaign.csv"
        compd.simulate_campaign("tripod-cmm", recording, seed=5, hidden=125)
        command = [sys.executable, "-m", "compd", "diagnose", str(recording)]
        done = subprocess.run(command, env={**os.environ, **TRACE}, capture_output=True, text=True, check=True)
    return _traced_lines(done.stderr)


MEASURES: Mapping[str, Callable[[], int]] = {
    "lines": lines,
    "files": files,
    "lines loaded by the daemon": loaded_by_the_daemon,
    "lines loaded by diagnose": loaded_by_diagnose,
    "doors": doors,
    "top-level commands": top_level_commands,
    "configuration keys": configuration_keys,
    "thresholds": threshold_numbers,
    "runtime dependencies": runtime_dependencies,
}


def _traced_lines(trace: str) -> int:
    modules = set(_TRACED.findall(trace))
    return sum(_lines(path) for path in map(_source, modules) if path is not None)


def _source(module: str) -> Path | None:
    place = ROOT.joinpath(*module.split("."))
    found = (path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file())
    return next(found, None)


def _lines(path: Path) -> int:
    return path.read_bytes().count(b"\n")


def _package(module: str) -> str:
    """The folder below `compd` that a module is in; "" for a module beside the folders."""
    name = ".".join(module.split(".")[:2])
    return name if ROOT.joinpath(*name.split("."), "__init__.py").is_file() else ""
