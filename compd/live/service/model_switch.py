"""Adopting a model file, or running it as a shadow, while the loop goes on with the model that it has.

The daemon opens no file that a client names. The client opens it, as it may, and sends the descriptor; it is read on a
thread of its own, since its file system may hang.
"""

from __future__ import annotations

import math
import queue
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import structlog

from compd.documents import MAX_BYTES
from compd.files import read_descriptor
from compd.live.machine import ModelText
from compd.live.memory import Control
from compd.live.service.message_keys.answers import ModelKeys
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.system import System

# A file of 1 MB is read in milliseconds, from a network in a second.
READ_WITHIN_S = 5.0
# Threads that wait for file systems which do not answer; what they wait for is taken to be of one kind.
MAX_HANGING = 8

_log = structlog.get_logger()


class ModelWish(NamedTuple):
    """What a client asks for: the model in `file`, "" for none; or with `hash` the one that runs as the shadow.

    file : a name for people; it is never opened. shadow : compute the model's correction, and do not apply it.
    """

    file: str = ""
    shadow: bool = False
    hash: str = ""


class _ReadModel(NamedTuple):
    """What became of reading the file of request `number`: its text, or why there is none."""

    number: int
    text: ModelText | None
    refusal: str


class ModelSwitch:
    """Passes a client's wish to the supervisor, and the answer of the loop that takes over to the client.

    One at a time; used by the publisher's thread.
    """

    def __init__(
        self,
        control: Control,
        wake: Callable[[], None],
        system: System,
        keeping: Callable[[Mapping[str, Any]], Mapping[str, Any]] = lambda models: {},
    ) -> None:
        """`wake` lets the publisher's thread call `look`; it is called from any thread. `keeping`: the keys of MODEL
        that say whether models last."""
        self._control = control
        self._keeping = keeping
        self._wake = wake
        self._system = system
        self._number = 0
        self._wish = ModelWish()
        self._answer: Callable[[bytes], None] | None = None
        self._read: queue.SimpleQueue[_ReadModel] = queue.SimpleQueue()
        self._read_until_s = math.inf
        self._readers: list[threading.Thread] = []

    def start(self, wish: ModelWish, descriptor: Callable[[], int | None], answer: Callable[[bytes], None]) -> None:
        """Begin to switch models; `answer` gets the MODEL or ERROR line when it is done.

        descriptor : gives the one that the client sent, which is closed when it has been read; None where there is
        none. Raises ProtocolError without it, and while another model is being read.
        """
        self._readers = [reader for reader in self._readers if reader.is_alive()]
        if self._answer is not None or len(self._readers) >= MAX_HANGING:
            raise ProtocolError(ErrorCode.BUSY, "another model is being read")
        if not wish.file:
            self._begin(wish, answer)
            self._pass_on(None)
            return
        if (sent := descriptor()) is None:
            raise ProtocolError(
                ErrorCode.BAD_MESSAGE,
                "file is a name, and the daemon opens no file: send an open descriptor of it with the line "
                "(SCM_RIGHTS, in the same sendmsg), as `compd model adopt FILE` and compd.client do",
            )
        self._begin(wish, answer)
        self._read_until_s = self._system.monotonic() + READ_WITHIN_S
        reader = self._system.thread(partial(self._read_file, self._number, wish.file, sent), "model file")
        self._readers.append(reader)
        reader.start()

    def look(self) -> None:
        """Pass on what has been read, and send the answer, if it has come."""
        while not self._read.empty():
            self._take(self._read.get_nowait())
        if self._answer is not None and self._system.monotonic() >= self._read_until_s:
            self._end(f"{self._wish.file} could not be read within {READ_WITHIN_S:g} s: its file system hangs")
        if self._answer is None or (message := self._control.model_answer.read()) is None:
            return
        number, summary, refusal = message
        if number != self._number:
            return
        if refusal:
            self._end(refusal)
            return
        role = "shadow" if self._wish.shadow else "applied"
        _log.info("shadow" if self._wish.shadow else "model adopted", file=summary.get(role, {}).get("file", "none"))
        self._send(ModelKeys.line(**summary, **self._keeping(summary)))

    def _begin(self, wish: ModelWish, answer: Callable[[bytes], None]) -> None:
        self._number += 1
        self._wish, self._answer = wish, answer

    def _read_file(self, number: int, file: str, descriptor: int) -> None:
        """On a thread of its own."""
        try:
            read = _ReadModel(number, ModelText(file, read_descriptor(descriptor, MAX_BYTES)), "")
        except OSError as error:
            read = _ReadModel(number, None, f"{file} cannot be read: {error.strerror or error}")
        self._read.put(read)
        self._wake()

    def _take(self, read: _ReadModel) -> None:
        if read.number != self._number or self._answer is None:  # it came too late
            return
        if read.text is None:
            self._end(read.refusal)
        else:
            self._pass_on(read.text)

    def _pass_on(self, text: ModelText | None) -> None:
        self._read_until_s = math.inf
        self._control.model_request.write((self._number, text, self._wish.shadow, self._wish.hash))
        self._control.wake_supervisor()

    def _end(self, refusal: str) -> None:
        self._send(ProtocolError(ErrorCode.MODEL_REFUSED, refusal).to_json())

    def _send(self, reply: bytes) -> None:
        answer, self._answer, self._read_until_s = self._answer, None, math.inf
        assert answer is not None
        answer(reply)
