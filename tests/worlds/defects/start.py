"""Start a module with a patched copy of compd: `python -m tests.worlds.defects.start COPY DIGEST MODULE [ARGUMENTS]`.

Only `tests.worlds.defects.patched` calls it.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path


def start(copy: Path, digest: str, module: str, arguments: list[str]) -> None:
    """Run `module` as a program that imports compd from `copy`.

    digest : of the sources from which the kernels below `copy` were compiled. numba compares each function's own file
    as well, so kernels in a patched file are compiled anew.
    """
    sys.path.insert(0, str(copy))
    from compd import jit

    assert Path(jit.__file__).is_relative_to(copy), jit.__file__
    vars(jit)["kernel_digest"] = lambda: digest
    jit.CACHE_DIRECTORY = str(copy / "kernels")
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    start(Path(sys.argv[1]), sys.argv[2], sys.argv[3], sys.argv[4:])
