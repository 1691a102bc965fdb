"""The models that the loop runs with, in shared memory: the service tells them, the next loop goes on with them."""

from __future__ import annotations

from typing import Any, NamedTuple

from compd.live.machine import ModelLoader, Models, ModelText
from compd.live.memory import SharedMessage

# Two model files with ledgers of years; memory that is not used costs nothing.
_CAPACITY = 64 * 1024 * 1024


class _Adopted(NamedTuple):
    """Model files of the applied model and of the shadow, and their summary."""

    applied: ModelText | None
    shadow: ModelText | None
    summary: dict[str, Any]


class AdoptedModels:
    """Applied model and shadow. The loop that has the turn writes them, before its first cycle."""

    def __init__(self, models: Models) -> None:
        """`models`: with which the daemon starts."""
        self._message = SharedMessage(_CAPACITY)
        self.write(models)

    def write(self, models: Models) -> None:
        """Replace them. Raises ValueError for model files that are too long."""
        applied, shadow = models
        self._message.write(_Adopted(applied.text, None if shadow is None else shadow.text, models.summary))

    @property
    def summary(self) -> dict[str, Any]:
        """For MODEL and STATUS, see `Models.summary`."""
        adopted: _Adopted = self._message.read()
        return adopted.summary

    def load(self, loader: ModelLoader) -> Models:
        """The models themselves. Raises CompdError where an effect of a user's own file can no longer be loaded."""
        adopted: _Adopted = self._message.read()
        return Models(loader.load(adopted.applied), None if adopted.shadow is None else loader.load(adopted.shadow))
