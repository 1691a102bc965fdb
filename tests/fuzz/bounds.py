"""How many examples, and which; and what is refused in compd's own words."""

from __future__ import annotations

import os
from collections.abc import Callable
from datetime import timedelta

from hypothesis import HealthCheck, Phase, settings

from compd.errors import CompdError

# A file that takes longer than this hangs, as far as its reader is concerned.
DEADLINE = timedelta(seconds=20)
FACTOR = int(os.environ.get("COMPD_FUZZ", "0"))


def examples(count: int) -> settings:
    """Settings for a test that tries `count` examples in a usual run."""
    return settings(
        max_examples=count * max(1, FACTOR),
        derandomize=not FACTOR,
        database=None,
        deadline=DEADLINE,
        # a smaller example of a file is seldom worth its minutes
        phases=(Phase.explicit, Phase.generate),
        suppress_health_check=list(HealthCheck),
    )


def refusal(attempt: Callable[[], object], *allowed: type[CompdError]) -> CompdError | None:
    """The error of a kind that is allowed, or None where the attempt succeeds; every other exception passes."""
    try:
        attempt()
    except allowed as error:
        return error
    return None


def is_told(error: CompdError | None) -> bool:
    """Whether nothing is refused, or every problem has a place and says what is wrong."""
    return error is None or (bool(error.problems) and all(problem.where and problem.what for problem in error.problems))
