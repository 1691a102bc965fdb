"""The commit by which a case was diagnosed: a run may go on for days, and over commits."""

from __future__ import annotations

import subprocess
from collections import Counter
from collections.abc import Sequence
from functools import cache

from tests.scoreboard.scoring import Result
from tests.support.paths import ROOT

UNKNOWN = "unknown"


@cache
def commit() -> str:
    """The commit of this tree, with "-dirty" where files are changed; UNKNOWN outside a repository."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--exclude=*"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return UNKNOWN
    return done.stdout.strip()


def commits_text(results: Sequence[Result]) -> str:
    """By which commits the results were made, each with the number of its cases."""
    counts = Counter(result.get("commit", UNKNOWN) for result in results)
    return ", ".join(f"{name} ({count})" if len(counts) > 1 else name for name, count in counts.most_common())
