"""The tutorial of the missing effect: from the error to the daemon that takes it out, as printed."""

from __future__ import annotations

import re

import pytest

from tests.support.pages import run_page
from tests.system.test_pages import TUTORIAL


@pytest.mark.long
@pytest.mark.sample
def test_the_tutorial_of_the_missing_effect(capsys: pytest.CaptureFixture[str]) -> None:
    """The error of the live tip ends below half of what it was, as the page says that it does."""
    run_page(TUTORIAL)
    said = capsys.readouterr().out
    print(said)
    (before_um,) = re.findall(r"residual, rms per coordinate +│ +([\d.]+) um", said)
    (after_um,) = re.findall(r"the tracker's differ by ([\d.]+) um", said)
    assert float(after_um) < 0.5 * float(before_um)
