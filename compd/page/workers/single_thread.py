"""Imported before numpy in the process from which workers are forked: a process with threads must not fork."""

from __future__ import annotations

import os

for _library in ("OPENBLAS", "OMP", "MKL", "NUMBA", "NUMEXPR"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"
