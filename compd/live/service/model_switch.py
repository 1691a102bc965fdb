"""Adopting a model file, or running it as a shadow, while the loop goes on with the model that it has."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import structlog

from compd.errors import CompdError
from compd.live.loop.commands import Commands
from compd.live.loop.model_loader import LiveModel, ModelLoader, Models
from compd.live.service.background_job import BackgroundJob
from compd.live.service.messages import ErrorCode, ProtocolError, line

_log = structlog.get_logger()


class ModelSwitch:
    """Reads and tries a model file on a thread of its own, then hands it to the loop. One file at a time.

    It is the only writer of `Commands.models`.
    """

    def __init__(self, loader: ModelLoader, commands: Commands) -> None:
        self._loader = loader
        self._commands = commands
        self._job = BackgroundJob("model", "another model is being read")

    def start(self, file: str, shadow: bool, answer: Callable[[bytes], None]) -> None:
        """Begin to switch to the model in `file`, "" for none; `answer` gets the MODEL or ERROR line when it is done.

        shadow : compute this model's correction and do not apply it. Raises ProtocolError while another is being read.
        """
        self._job.start(lambda: self._switch(file, shadow), answer)

    def stop(self) -> None:
        """Return when nothing is being read."""
        self._job.join()

    def _switch(self, file: str, shadow: bool) -> bytes:
        try:
            model = self._loader.read(Path(file)) if file else None
        except CompdError as error:
            _log.warning("model refused", file=file, reason=str(error))
            return ProtocolError(ErrorCode.MODEL_REFUSED, str(error)).to_json()
        models = self._next_models(model, shadow)
        self._commands.models = models
        _log.info("shadow" if shadow else "model adopted", file=file or "none")
        return line({"class": "MODEL", **models.summary})

    def _next_models(self, model: LiveModel | None, shadow: bool) -> Models:
        """The pair of applied and shadow model with `model` (None: no effects, or no shadow) in its place."""
        applied, running_shadow = self._commands.models or Models(self._loader.without_effects)
        if shadow:
            return Models(applied, model)
        if model is not None and running_shadow is not None and model.hash == running_shadow.hash:
            # The same object that ran as a shadow: its effects keep their memory.
            return Models(running_shadow)
        return Models(model or self._loader.without_effects, running_shadow)
