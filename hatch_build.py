"""A build hook: the documentation's built pages go into the wheel, as compd/documentation/, and into the sdist.

`make docs` builds them into docs/_build/html. A wheel that is built without them works; `compd docs` then says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BUILT = "docs/_build/html"
INSTALLED = "compd/documentation"


class DocumentationHook(BuildHookInterface):
    """Adds every built page, but for an editable installation, which reads the checkout's."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before a wheel or an sdist is built; files that git ignores are included by force."""
        if version == "editable":
            return
        built = Path(self.root) / BUILT
        # in an sdist they stay where they are, so that a wheel built from it has them too
        target = BUILT if self.target_name == "sdist" else INSTALLED
        for path in sorted(built.rglob("*")):
            name = path.relative_to(built)
            if path.is_file() and not any(part.startswith(".") for part in name.parts):
                build_data["force_include"][str(path)] = f"{target}/{name.as_posix()}"
