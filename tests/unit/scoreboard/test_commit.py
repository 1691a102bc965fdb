"""Results say by which commit they were made."""

from __future__ import annotations

import re

import pytest

from tests.scoreboard.commit import UNKNOWN, commit, commits_text
from tests.support.paths import ROOT


def test_the_commit_is_that_of_the_tree():
    if not (ROOT / ".git").exists():
        pytest.skip("the tree is no repository")
    assert re.fullmatch(r"[0-9a-f]{7,40}(-dirty)?", commit())


def test_results_of_several_commits_are_counted():
    results = [{"commit": "abc1234"}, {"commit": "def5678"}, {"commit": "abc1234"}, {}]
    assert commits_text(results) == f"abc1234 (2), def5678 (1), {UNKNOWN} (1)"
    assert commits_text(results[:1]) == "abc1234"
