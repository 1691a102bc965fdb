"""The tutorial of the missing effect: from the error to the daemon that takes it out, as printed."""

from __future__ import annotations

import pytest

from tests.support.pages import run_page
from tests.system.test_pages import TUTORIAL


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.timeout(600)
def test_the_tutorial_of_the_missing_effect() -> None:
    run_page(TUTORIAL)
