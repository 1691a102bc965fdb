"""Imported before numpy in the process from which workers are forked: a process with threads must not fork.

It ends with the page's server at once, also while it imports what is preloaded: it keeps the server's output open.
"""

from __future__ import annotations

import os

from compd.live.system import end_with_parent

for _library in ("OPENBLAS", "OMP", "MKL", "NUMBA", "NUMEXPR"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"

end_with_parent()
