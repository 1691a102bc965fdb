"""The page of the Python interface: its text is the docstrings, read by Sphinx when it builds the page."""

from __future__ import annotations

import inspect

import compd
from compd.client import Client
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import Comparison
from compd.configuration import Configuration
from compd.diagnosis.next_measurement import MeasurementPlan
from compd.diagnosis.verdict import (
    CandidateResult,
    Diagnosis,
    DiagnosisStep,
    EmpiricalFinding,
    ParameterEstimate,
    Rival,
)
from compd.errors import Problem
from compd.model.effect import FittedEffect
from compd.model_file import EffectNumber, ModelFile, ModelStep
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
    ModelFile,
    EffectNumber,
    ModelStep,
    FittedEffect,
    MeasurementPlan,
    CampaignFiles,
    Client,
    Problem,
)
HEAD = """# Python interface

`import compd` offers the names of this page and imports each from its module when it is first used. The same functions
are behind the commands of the [command line](index.md). How to use them: [use compd from Python and
notebooks](../how-to/use-python.md).

Paths may be texts or `pathlib.Path`. N is the number of rows of a recording, m of its measured coordinates, n of links, P
of fitted numbers. {M} is the frame of the surface plate, {P} that of the moving platform; every length says its unit
in its name. A number that is not known is nan, never 0. Every error that compd raises on purpose is a `CompdError`
whose problems say where, what, which value, what is allowed and what to do.

Results show themselves as tables in a notebook. Those with `to_dataframe()` need pandas for it, which
`pip install "compd[notebook]"` installs along.
"""


def page() -> str:
    """Markdown with one directive for each name."""
    public = {name: getattr(compd, name) for name in compd.__all__}
    functions = [f"compd.{name}" for name, value in public.items() if inspect.isfunction(value)]
    classes = [f"compd.{name}" for name, value in public.items() if inspect.isclass(value)]
    results = [f"{kind.__module__}.{kind.__qualname__}" for kind in RESULTS]
    sections = {
        "Functions": [_directive("autofunction", name) for name in functions],
        "Effects and errors": [_directive("autoclass", name) for name in classes],
        "Results": [_directive("autoclass", name) for name in results],
    }
    return "\n".join([HEAD, *(line for title, parts in sections.items() for line in (f"## {title}", "", *parts))])


def _directive(kind: str, name: str) -> str:
    options = "   :members:\n" if kind == "autoclass" else ""
    return f"```{{eval-rst}}\n.. {kind}:: {name}\n{options}```\n"
