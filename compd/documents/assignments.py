"""KEY=VALUE, as on the command line, with VALUE in YAML."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from compd.documents.yaml_reader import parse_yaml
from compd.errors import ConfigurationError


def assigned(option: str, assignments: Sequence[str], example: str) -> dict[str, Any]:
    """The data of KEY=VALUE. ConfigurationError for an assignment that is none."""
    data = {}
    for assignment in assignments:
        key, equals, value = assignment.partition("=")
        if not equals:
            raise ConfigurationError.of(option, "is not KEY=VALUE", value=assignment, allowed=f"{option} {example}")
        data[key], _ = parse_yaml(value, Path(f"{option} {key}"))
    return data
