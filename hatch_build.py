"""A build hook: what is made once goes into the wheel: compiled kernels and the documentation's pages.

The kernels of each level of x86-64 go in as compd/compiled_kernels/. They fit the Python, numba and LLVM of the build;
elsewhere the first start compiles. Another architecture's wheel has none.

`make docs` builds pages into docs/_build/html; they go in as compd/documentation/, and into the sdist. Without them the
pages go in as they are written, in Markdown.
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
# below docs/: the pages as they are written, without what builds make
WRITTEN_PAGES = ("*.md", "[a-z]*/*.md", "pictures/*.svg", "pictures/*.png")
KERNELS = "compd/compiled_kernels"


class BuildHook(BuildHookInterface):
    """Adds kernels and pages, but for an editable installation, which has the checkout's."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before a wheel or an sdist is built; files that git ignores are included by force."""
        if version == "editable":
            return
        pages = Path(self.root) / PAGES
        if self.target_name == "sdist":
            # where they are, so that a wheel built from it has them too
            self._include(pages, PAGES, build_data)
        elif pages.is_dir():
            self._include(pages, INSTALLED_PAGES, build_data)
        else:
            self._include(Path(self.root) / "docs", INSTALLED_PAGES, build_data, WRITTEN_PAGES)
        if self.target_name == "wheel" and platform.machine() in ("x86_64", "AMD64"):
            self._compiled = tempfile.TemporaryDirectory(prefix="compd-kernels-")
            _compile(Path(self.root), self._compiled.name)
            self._include(Path(self._compiled.name), KERNELS, build_data)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Called by hatchling once the wheel is written."""
        if hasattr(self, "_compiled"):
            self._compiled.cleanup()

    def _include(
        self, directory: Path, target: str, build_data: dict[str, Any], patterns: tuple[str, ...] = ("**/*",)
    ) -> None:
        """The files below `directory` that fit a pattern, but for hidden ones and locks."""
        for path in sorted(path for pattern in patterns for path in directory.glob(pattern)):
            name = path.relative_to(directory)
            if path.is_file() and path.suffix != ".lock" and not any(part.startswith(".") for part in name.parts):
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
