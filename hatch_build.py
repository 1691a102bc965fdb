"""A build hook: what is made once goes into the wheel: compiled kernels and the documentation's pages.

The kernels of each level of x86-64 go in as compd/compiled_kernels/. They fit the Python, numba and LLVM of the build;
elsewhere the first start compiles. Another architecture's wheel has none.

`make docs` builds pages into docs/_build/html; they go in as compd/documentation/, and into the sdist. A wheel that is
built without them works; `compd docs` then says so.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PAGES, INSTALLED_PAGES = "docs/_build/html", "compd/documentation"
KERNELS = "compd/compiled_kernels"


class BuildHook(BuildHookInterface):
    """Adds kernels and pages, but for an editable installation, which has the checkout's."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before a wheel or an sdist is built; files that git ignores are included by force."""
        if version == "editable":
            return
        # in an sdist the pages stay where they are, so that a wheel built from it has them too
        self._include(Path(self.root) / PAGES, PAGES if self.target_name == "sdist" else INSTALLED_PAGES, build_data)
        if self.target_name == "wheel" and platform.machine() in ("x86_64", "AMD64"):
            self._compiled = tempfile.TemporaryDirectory(prefix="compd-kernels-")
            _compile(Path(self.root), self._compiled.name)
            self._include(Path(self._compiled.name), KERNELS, build_data)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Called by hatchling once the wheel is written."""
        if hasattr(self, "_compiled"):
            self._compiled.cleanup()

    def _include(self, directory: Path, target: str, build_data: dict[str, Any]) -> None:
        for path in sorted(directory.rglob("*")):
            name = path.relative_to(directory)
            if path.is_file() and path.name != "lock" and not any(part.startswith(".") for part in name.parts):
                build_data["force_include"][str(path)] = f"{target}/{name.as_posix()}"


def _compile(root: Path, directory: str) -> None:
    """Compile all kernels for each level into `directory`. Raises RuntimeError if that fails."""
    path = os.pathsep.join(filter(None, [str(root), os.environ.get("PYTHONPATH")]))
    command = [sys.executable, "-m", "compd.compile_kernels", directory]
    if subprocess.run(command, cwd=root, env=os.environ | {"PYTHONPATH": path}, check=False).returncode != 0:
        raise RuntimeError(
            "the kernels do not compile, see above; "
            "a build without isolation needs what pyproject.toml lists for hatch_build.py"
        )
