"""Adopting a model file, or running it as a shadow: read and tried on a thread of its own, then handed to the loop."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import structlog

from compd.errors import CompdError
from compd.live.loop.commands import Commands
from compd.live.loop.model_loader import LiveModel, ModelLoader, Models
from compd.live.service.background_job import BackgroundJob
from compd.live.service.messages import ErrorCode, ModelOrder, ProtocolError, line

_log = structlog.get_logger()


class ModelSwitch:
    """Takes one order at a time, and is the only writer of `commands.models`: neither loop nor publisher waits."""

    def __init__(self, loader: ModelLoader, commands: Commands) -> None:
        self._loader = loader
        self._commands = commands
        self._errand = BackgroundJob("model", "another model is being read")

    def take(self, order: ModelOrder, answer: Callable[[bytes], None]) -> None:
        """Start; `answer` gets the MODEL or ERROR line when it is done. Raises ProtocolError while one is running."""
        self._errand.begin(lambda: self._taken(order), answer)

    def stop(self) -> None:
        """Returns when nothing is being read."""
        self._errand.join()

    def _taken(self, order: ModelOrder) -> bytes:
        """Do it; the MODEL or ERROR line."""
        try:
            model = self._loader.read(Path(order.file)) if order.file else None
        except CompdError as error:
            _log.warning("model refused", file=order.file, reason=str(error))
            return ProtocolError(ErrorCode.MODEL_REFUSED, str(error)).to_json()
        models = self._changed(order, model)
        self._commands.models = models
        _log.info("shadow" if order.shadow else "model adopted", file=order.file or "none")
        return line({"class": "MODEL", **models.summary})

    def _changed(self, order: ModelOrder, model: LiveModel | None) -> Models:
        applied, shadow = self._commands.models or Models(self._loader.without_effects)
        if order.shadow:
            return Models(applied, model)
        if model is not None and shadow is not None and model.hash == shadow.hash:
            # the very object that ran as a shadow: its effects keep what they remember
            return Models(shadow)
        return Models(model or self._loader.without_effects, shadow)
