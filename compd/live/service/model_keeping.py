"""Whether the applied model is the one with which the daemon starts again, and what keeps it where it is not."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


class ModelKeeping:
    """Compares the applied model with `state.model_file`."""

    def __init__(self, configuration: Path, model_file: str | None) -> None:
        """`model_file`: with which the daemon starts by its `configuration`; None for the machine without effects."""
        self._configuration = configuration
        self._model_file = model_file or ""

    def keys(self, models: Mapping[str, Any]) -> dict[str, Any]:
        """The keys `kept` and `kept_text` of MODEL, for the models that the daemon runs with."""
        file = models["applied"].get("file", "")
        if file == self._model_file:
            return {"kept": True, "kept_text": "kept over a restart"}
        key = f"write `model_file: {file}`" if file else f"remove `model_file: {self._model_file}`"
        text = f"not kept over a restart; to keep it, {key} under `state:` in {self._configuration}"
        return {"kept": False, "kept_text": text}
