"""The limits of `numbers.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import yaml

LIMITS: Mapping[str, int] = yaml.safe_load(Path(__file__).with_name("numbers.yaml").read_text(encoding="utf-8"))
