"""The example: a simulated recording, its diagnosis, and what the diagnosis computed on the way."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

from compd.arrays import FloatArray, IntArray
from compd.cli.app import app
from compd.comparison import compare, neighbour_blocks, open_recording
from compd.configuration import shipped_configuration
from compd.diagnosis import Candidate, Diagnosis, DiagnosisProblem, diagnose
from compd.diagnosis.recording_diagnosis import explain_residual
from compd.diagnosis.search.cross_validation import row_splits
from compd.diagnosis.search.explanation import Explanation
from compd.model.library import load_library

SEED, HIDDEN = 5, "link_elasticity"
# A second member that would lower the loss a little, and an effect that does nearly the same: for the scores.
SECOND, ALIKE = "frame_rod_expansion", "joint_contact"


@dataclass(frozen=True, eq=False)
class Example:
    """What the spreadsheet and the pictures show.

    problem, explanation : of the second pass, with the final weights of the rows.
    members : the candidates `HIDDEN`, `SECOND` and `ALIKE`, by their place.
    splits : each (N,) the fold of every row.  block : (N,) its block of neighbouring rows.
    robust_fit : (m + 1,) the constant of each coordinate and the parameter of `HIDDEN`, in the whitened robust fit by
        which rows are weighed.
    """

    diagnosis: Diagnosis
    problem: DiagnosisProblem
    explanation: Explanation
    members: tuple[int, int, int]
    splits: tuple[IntArray, ...]
    block: IntArray
    robust_fit: FloatArray

    @property
    def candidates(self) -> list[Candidate]:
        """The three candidates."""
        return [self.explanation.losses.candidates[k] for k in self.members]


def make_example() -> Example:
    """Simulate the recording and diagnose it, as `compd sim campaign` and `compd diagnose` do."""
    with _temporary_directory():
        shape = [str(shipped_configuration("tripod-cmm.yaml")), "--seed", str(SEED), "--effect", HIDDEN]
        with redirect_stdout(StringIO()):
            app(["sim", "campaign", *shape, "--out", "loaded.csv"], standalone_mode=False)
        aligned = open_recording(Path("loaded.csv"))
    effects = list(load_library().values())
    explanation = explain_residual(compare(aligned), effects)
    problem, best = explanation.problem, explanation.losses.best_variants
    members = tuple(best[name].members[0] for name in (HIDDEN, SECOND, ALIKE))
    return Example(
        diagnosis=diagnose(aligned, (), None, effects),
        problem=problem,
        explanation=explanation,
        members=(members[0], members[1], members[2]),
        splits=row_splits(aligned),
        block=neighbour_blocks(aligned.recording),
        robust_fit=problem.weigh_beside([explanation.losses.candidates[members[0]]]).fit,
    )


@contextmanager
def _temporary_directory() -> Iterator[None]:
    previous = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="compd-worked-example-") as directory:
        os.chdir(directory)
        try:
            yield
        finally:
            os.chdir(previous)
