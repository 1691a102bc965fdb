"""The page of the Python interface: its text is the docstrings, read by Sphinx when it builds the page."""

from __future__ import annotations

import inspect

import compd
from compd.client import Client
from compd.comparison import AlignedRecording, Comparison
from compd.configuration import Configuration
from compd.diagnosis import CandidateResult, Diagnosis, DiagnosisStep, EmpiricalFinding
from compd.diagnosis.findings import NonlinearConstant, ParameterEstimate, Rival
from compd.errors import (
    ConfigurationError,
    DaemonError,
    KinematicsError,
    PluginError,
    Problem,
    RecordingError,
    StateError,
)
from compd.model.effects import FittedEffect
from compd.model.external import ExternalPrediction
from compd.model_file import EffectNumber, ModelFile, ModelStep
from compd.planning import MeasurementPlan
from compd.simulation.campaign.simulate_campaign import CampaignFiles

# What the functions return, and what is in it.
RESULTS: tuple[type, ...] = (
    Configuration,
    AlignedRecording,
    Comparison,
    Diagnosis,
    DiagnosisStep,
    ParameterEstimate,
    Rival,
    CandidateResult,
    EmpiricalFinding,
    NonlinearConstant,
    ModelFile,
    EffectNumber,
    ModelStep,
    FittedEffect,
    ExternalPrediction,
    MeasurementPlan,
    CampaignFiles,
    Client,
)
# What is behind a CompdError.
ERRORS: tuple[type, ...] = (
    ConfigurationError,
    RecordingError,
    StateError,
    KinematicsError,
    PluginError,
    DaemonError,
    Problem,
)
# Public for the rooms of compd, of no use in a notebook.
INTERNAL = (
    "attitude_residual_urad",
    "columns",
    "gauge_objects",
    "predicted_mm",
    "propagated",
    "registration_columns",
    "sensitivity",
    "state",
    "usable",
    "write_to",
)
HEAD = """# Python interface

`import compd` offers the names of this page and imports each from its module when it is first used. The same functions
are behind the commands of the [command line](index.md). How to use them: [use compd from Python and
notebooks](../how-to/use-python.md).

Paths may be texts or `pathlib.Path`. N is the number of rows of a recording, m of its measured coordinates, n of
links, P of fitted numbers. {M} is the frame of the surface plate, {P} that of the moving platform; every length says
its unit in its name. A number that is not known is nan, never 0. Every error that compd raises on purpose is a
`CompdError` whose problems say where, what, which value, what is allowed and what to do.

Results show themselves as tables in a notebook. Those with `to_dataframe()` need pandas for it, which
`pip install "compd[notebook]"` installs along.
"""


# As a reader types them: the examples of each use the files and values of those before it.
ORDER = (
    "load_machine",
    "simulate_campaign",
    "open_recording",
    "compare",
    "diagnose",
    "load_effects",
    "add_effect",
    "open_model",
    "open_sample",
    "plan_measurement",
    "plan_calibration",
    "calibrate",
    "write_built_machine",
    "connect",
    "Effect",
    "Parameter",
    "Constant",
    "memoryless_basis",
    "Kinematics",
    "CompdError",
)


def page() -> str:
    """Markdown with one directive for each name."""
    public = {name: getattr(compd, name) for name in ORDER}
    functions = [f"compd.{name}" for name, value in public.items() if inspect.isfunction(value)]
    classes = [f"compd.{name}" for name, value in public.items() if inspect.isclass(value)]
    effects = [name for name in classes if not issubclass(getattr(compd, name.removeprefix("compd.")), Exception)]
    errors = [name for name in classes if name not in effects]
    sections = {
        "Functions": [_directive("autofunction", name) for name in functions],
        "Results": [_directive("autoclass", f"{_path(kind)}()") for kind in RESULTS],
        "Effects": [_directive("autoclass", name) for name in effects],
        "Errors": [_directive("autoclass", name) for name in [*errors, *map(_path, ERRORS)]],
    }
    return "\n".join([HEAD, *(line for title, parts in sections.items() for line in (f"## {title}", "", *parts))])


def _path(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _directive(kind: str, name: str) -> str:
    options = f"   :members:\n   :exclude-members: {', '.join(INTERNAL)}\n" if kind == "autoclass" else ""
    if name == f"{_path(Client)}()":
        options += "   :inherited-members:\n"
    return f"```{{eval-rst}}\n.. {kind}:: {name}\n{options}```\n"
