"""Adopting a model file, or running it as a shadow, while the loop goes on with the model that it has."""

from __future__ import annotations

from collections.abc import Callable

import structlog

from compd.live.processes.control import Control
from compd.live.service.messages import ErrorCode, ProtocolError, line

_log = structlog.get_logger()


class ModelSwitch:
    """Passes a client's wish to the supervisor, and the answer of the loop that takes over to the client.

    One file at a time; used by the publisher's thread.
    """

    def __init__(self, control: Control) -> None:
        self._control = control
        self._number = 0
        self._file = ""
        self._shadow = False
        self._answer: Callable[[bytes], None] | None = None

    def start(self, file: str, shadow: bool, user: int, answer: Callable[[bytes], None]) -> None:
        """Begin to switch to the model in `file`, "" for none; `answer` gets the MODEL or ERROR line when it is done.

        shadow : compute this model's correction and do not apply it. user : number of the user who asks, whose own file
        may be used. Raises ProtocolError while another is being read.
        """
        if self._answer is not None:
            raise ProtocolError(ErrorCode.BUSY, "another model is being read")
        self._number += 1
        self._file, self._shadow, self._answer = file, shadow, answer
        self._control.model_request.write((self._number, file, shadow, user))
        self._control.wake_supervisor()

    def look(self) -> None:
        """Send the answer, if it has come."""
        answer = self._answer
        if answer is None or (message := self._control.model_answer.read()) is None:
            return
        number, summary, refusal = message
        if number != self._number:
            return
        self._answer = None
        if refusal:
            answer(ProtocolError(ErrorCode.MODEL_REFUSED, refusal).to_json())
            return
        _log.info("shadow" if self._shadow else "model adopted", file=self._file or "none")
        answer(line({"class": "MODEL", **summary}))
