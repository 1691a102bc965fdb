"""The models that the loop runs with, in shared memory: the service tells them, the next loop goes on with them."""

from __future__ import annotations

import pickle
from typing import Any, NamedTuple

from compd.live.loop.model_loader import ModelLoader, Models, ModelText
from compd.live.memory.shared_record import SharedRecord

# Two model files with ledgers of years; memory that is not used costs nothing.
_CAPACITY = 64 * 1024 * 1024


class _Adopted(NamedTuple):
    """Model files of the applied model and of the shadow, and their summary."""

    applied: ModelText | None = None
    shadow: ModelText | None = None
    summary: dict[str, Any] = {}  # noqa: RUF012


class AdoptedModels:
    """Applied model and shadow. The loop that has the turn writes them, before its first cycle."""

    def __init__(self, models: Models) -> None:
        """`models`: with which the daemon starts."""
        self._record = SharedRecord(_CAPACITY)
        self._version = 0
        self._adopted = _Adopted()
        self.write(models)

    def write(self, models: Models) -> None:
        """Replace them. Raises ValueError for model files that are too long."""
        applied, shadow = models
        adopted = _Adopted(applied.text, None if shadow is None else shadow.text, models.summary)
        self._record.write(pickle.dumps(tuple(adopted)))

    @property
    def summary(self) -> dict[str, Any]:
        """For MODEL and STATUS, see `Models.summary`."""
        return self._read().summary

    def load(self, loader: ModelLoader) -> Models:
        """The models themselves. Raises CompdError where an effect of a user's own file can no longer be loaded."""
        applied, shadow, _ = self._read()
        return Models(loader.load(applied), None if shadow is None else loader.load(shadow))

    def _read(self) -> _Adopted:
        if (version := self._record.version) != self._version and (content := self._record.read()):
            self._adopted, self._version = _Adopted(*pickle.loads(content)), version
        return self._adopted
