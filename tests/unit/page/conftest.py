from __future__ import annotations

import multiprocessing

import pytest


@pytest.fixture(autouse=True)
def no_worker_outlives_its_test():
    yield
    for process in multiprocessing.active_children():
        process.kill()
        process.join()
