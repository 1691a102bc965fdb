"""Why a row has no solution, and where the limits lie."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compd.errors import KinematicsError, Problem


class Reason(IntEnum):
    """What a solver says of one row. Anything but OK comes with nan in every result of that row.

    NOT_FINITE is the smallest failure on purpose: what follows a failed step sees its nan and reports
    NOT_FINITE, so the maximum over the steps is the reason of the step that failed first.
    """

    OK = 0
    NOT_FINITE = 1  # nan or inf among the input
    UNREACHABLE = 2  # no pose has these lengths: negative, or shorter or longer than the parts allow
    NO_CONVERGENCE = 3  # Newton found no pose from this guess: unreachable, or the guess is too far away
    NEAR_SINGULAR = 4  # a small error of length is a large error of pose
    OTHER_ASSEMBLY = 5  # a pose with the right lengths, but in another assembly than the guess

    @property
    def meaning(self) -> str:
        """In words; "" of a pose that was found."""
        return _MEANING.get(self, "")


_MEANING: dict[Reason, str] = {
    Reason.NOT_FINITE: "an input is nan or infinite",
    Reason.UNREACHABLE: "no pose has these lengths",
    Reason.NO_CONVERGENCE: "no pose was found from this guess",
    Reason.NEAR_SINGULAR: "too near a singular pose",
    Reason.OTHER_ASSEMBLY: "the pose found lies in another assembly (mirrored or turned over)",
}

# Pose error over length error: root of the sum of squares, the lengths being in error independently, rotations
# times the platform's radius. In its workspace a tripod or hexapod of usual shape has 2 to 5. At 100 one
# micrometre on a scale is a tenth of a millimetre on the platform: no correction is worth sending from there.
AMPLIFICATION_LIMIT = 100.0

# Newton converges quadratically: after a step of 1e-6 mm, on parts of 100 mm, the error left is below 1e-13 mm.
STEP_TOLERANCE_MM = 1e-6

# Ten times the rounding of coordinates of 1e4 mm; what closes worse than this has not converged.
RESIDUAL_TOLERANCE_MM = 1e-8

# From machine zero to the edge of a workspace Newton takes 4 to 7 steps.
ITERATION_LIMIT = 30

# A Newton step longer than this fraction of the mechanism's size is shortened: a long one may leap into
# another assembly.
STEP_LIMIT = 0.5


def require(reason: NDArray[np.int64] | np.int64 | int, what: str, next_step: str = "") -> None:
    """Raise KinematicsError unless every row is OK; names the rows (the first ten) and their reasons.

    what : what was computed, as a person knows it.  next_step : what to do if it failed.
    """
    codes = np.asarray(reason)
    if not codes.any():
        return
    single = codes.ndim == 0
    failed: list[tuple[Any, ...]] = [tuple(index) for index in np.argwhere(codes)]
    problems = [
        Problem(
            what if single else f"{what}, row {', '.join(str(i) for i in index)}",
            f"{Reason(int(codes[index])).name}: {Reason(int(codes[index])).meaning}",
            next_step=next_step,
        )
        for index in failed[:10]
    ]
    if len(failed) > len(problems):
        problems.append(Problem(what, f"and {len(failed) - len(problems)} more rows"))
    raise KinematicsError(problems)
