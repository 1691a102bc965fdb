"""Garbage collection is off while modules load, and on again after."""

from __future__ import annotations

import gc

import pytest

from compd.cli.loading import loading


def test_the_collector_is_on_again_also_after_a_module_that_cannot_be_loaded():
    with loading():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ImportError), loading():
        raise ImportError
    assert gc.isenabled()
