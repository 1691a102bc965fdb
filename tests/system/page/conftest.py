from __future__ import annotations

import pytest

from tests.support.live_page import CHROMIUM, browser, opened, served


@pytest.fixture(scope="package")
def chromium():
    if not CHROMIUM:
        pytest.skip("Chromium is not there; on Debian: apt-get install chromium")
    with browser() as started:
        yield started


@pytest.fixture(scope="package")
def live(chromium):
    with served() as page:
        yield page


@pytest.fixture
def tab(chromium, live):
    with opened(chromium, live) as opened_tab:
        yield opened_tab
