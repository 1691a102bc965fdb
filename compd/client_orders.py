"""What a client of the daemon orders: requests that change what the machine does."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from pathlib import Path

from compd.client_connection import Message
from compd.errors import DaemonError
from compd.files import open_regular


class ClientOrders(ABC):
    """Orders, each a method named after its message. They are asked in the name of whoever the client asks for."""

    def __init__(self, by: str) -> None:
        """`by`: as in `connect`."""
        self._by = by

    @abstractmethod
    def _ask(self, message: Message, answer: str, descriptor: int | None = None) -> Message:
        """Send a message, and return the next one of class `answer`."""

    def release(self) -> None:
        """Give the controller's role back: the daemon returns to CMM mode.

        Over the Unix socket it takes the role from whichever client has it.

        Raises
        ------
        DaemonError
            Where this client is not the controller, or nobody is.
        """
        self._order({"class": "RELEASE"})

    def zero(self, replace: bool = False) -> Message:
        """Take machine zero, with the machine at rest at its zero position. Unix socket only; takes about a second.

        Parameters
        ----------
        replace : bool
            Take it also where a gauge differs by more than 0.5 mm from the machine zero until now, or is not believed.

        Returns
        -------
        dict
            ZERO with `taken_at`, `path` of the file, `readings_mm` by channel, `quantities` by name (those that could
            not be read are listed in `without`) and, where there was a machine zero before, `changed_mm` by channel.

        Raises
        ------
        DaemonError
            Where a gauge cannot be read, the machine moves, or the file cannot be written; and where it needs
            `replace`: the problem's value is then "zero_differs".
        """
        return self._order({"class": "ZERO", "replace": True} if replace else {"class": "ZERO"})

    def accept(self, gauge: str) -> Message:
        """Let the daemon believe a gauge again that jumped, or came back with another value. Unix socket only.

        Look at the gauge first: what it reads from now on is taken as it is.

        Parameters
        ----------
        gauge : str
            A gauge, one channel of it as ``"gauge.channel"``, or ``"all"``.

        Returns
        -------
        dict
            ACCEPT, after a second, with `gauges`: the channels that are believed now and were not; `believed_for_s`: of
            each, for how long, s; `not_believed`: the reason of each that is not believed after it either.

        Raises
        ------
        DaemonError
            Where there is no such gauge.
        """
        return self._order({"class": "ACCEPT", "gauge": gauge})

    def poll(self, gauge: str) -> Message:
        """Have a gauge polled at once that did not answer, and is asked seldom since. Unix socket only.

        Parameters
        ----------
        gauge : str
            Its name in the configuration. It is polled within a second, if its line is open; `status` counts its polls.

        Returns
        -------
        dict
            POLL.

        Raises
        ------
        DaemonError
            Where there is no such gauge, or its device sends by itself.
        """
        return self._order({"class": "POLL", "gauge": gauge})

    def model(self, file: str | Path | None = None, shadow: bool = False, descriptor: int | None = None) -> Message:
        """Ask which models the daemon runs with; with `file`, adopt that model first. Unix socket only.

        The file is opened here, as this process may, and the daemon gets the open descriptor with the request: it
        opens no file itself.

        Parameters
        ----------
        file : str or Path, optional
            A model file; ``""`` for the machine without effects, or for no shadow; None to change nothing.
        shadow : bool
            Compute the correction of this model beside the applied one, and do not apply it.
        descriptor : int, optional
            Of the file, where the caller has opened it; `file` is then only its name. It is left open.

        Returns
        -------
        dict
            MODEL with `applied` and, if there is one, `shadow`: `effects`, `not_live`, `from_20_degC`, `model` (the
            file's hash) and `file`; `kept`, whether the daemon starts with the applied model again, and `kept_text`,
            what keeps it.

        Raises
        ------
        DaemonError
            Where the file cannot be read, or the daemon cannot use it; the models are as before.
        """
        if file is None:
            return self._ask({"class": "MODEL"}, "MODEL")
        request: Message = {"class": "MODEL", "file": str(file) and str(Path(file).absolute()), "shadow": shadow}
        if descriptor is not None or not request["file"]:
            return self._order(request, descriptor)
        opened = _opened(Path(file))
        try:
            return self._order(request, opened)
        finally:
            os.close(opened)

    def adopt_shadow(self, hash: str) -> Message:
        """Apply the model that runs as the shadow: exactly what has been looked at, whatever has become of its file.

        Unix socket only.

        Parameters
        ----------
        hash : str
            Of the model, as MODEL and STATUS tell it.

        Returns
        -------
        dict
            MODEL, as `model` returns it.

        Raises
        ------
        DaemonError
            Where no model of this hash runs as the shadow; the models are as before.
        """
        return self._order({"class": "MODEL", "hash": hash})

    def _order(self, message: Message, descriptor: int | None = None) -> Message:
        """Ask for what changes the machine, in the name of whoever this client asks for."""
        name: str = message["class"]
        return self._ask(message | ({"by": self._by} if self._by else {}), name, descriptor)


def _opened(file: Path) -> int:
    """A descriptor of a regular file, open for reading. Raises DaemonError."""
    try:
        return open_regular(file)
    except OSError as error:
        raise DaemonError.of(
            str(file), f"cannot be read: {error.strerror or error}", next_step="name a model file that you may read"
        ) from error
