"""Fixtures of the live rooms."""

from __future__ import annotations

from contextlib import closing

import pytest

from tests.support.service import Service


@pytest.fixture
def service(tmp_path):
    """A publisher on real sockets, with the loop's side in the test's hands."""
    with closing(Service(tmp_path)) as service:
        yield service
