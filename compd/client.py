"""A client of the running daemon: blocking, one connection, no dependency beyond the standard library.

A program that drives a machine, or only watches it, connects to the daemon's TCP port or Unix socket and receives
setpoints::

    from compd.client import connect

    with connect("127.0.0.1:7750") as client:
        print(client.version["machine"])
        for setpoint in client.watch(rate_hz=10):
            if setpoint["valid"]:
                print(setpoint["tip_M_mm"], "mm in the frame of the surface plate")
            else:
                print(setpoint["state"], setpoint["reason"])

A controller also says where the tip shall be, and commands its drives with the corrected scale readings::

    with connect("/run/compd/compd.sock") as client:
        while True:
            client.target(tip_B0_mm=[10.0, 0.0, -500.0], id=1)  # the next one, or the same again: a target grows old
            setpoint = client.latest(timeout_s=1.0)
            if setpoint["valid"] and setpoint.get("target_id") == 1:
                drive_to(setpoint["scale_setpoint_mm"])

Messages are dictionaries with the keys of the protocol. Lengths are in mm, angles in rad, times in seconds of the
daemon's monotonic clock; a vector's name ends in its frame and unit. What is unknown is absent from a message, so a
key that not every setpoint has is read with `get`. A setpoint must not be used later than its `valid_until`, which
`Client.latest` sees to. A program that keeps one for longer compares it with `time.monotonic()` on the daemon's
computer, and elsewhere counts `valid_until - time_s` from the moment of arrival. A target grows old too: a controller
repeats it, see `Client.target`.

Whatever goes wrong raises `compd.errors.DaemonError`, which says what to do.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from compd.client_connection import ClientConnection, Message, open_connection
from compd.client_orders import ClientOrders
from compd.client_setpoints import ReadSetpoints
from compd.errors import DaemonError

__all__ = ["DEFAULT_ADDRESS", "Client", "Message", "connect"]

DEFAULT_ADDRESS = "127.0.0.1:7750"


def connect(
    address: str | Path = DEFAULT_ADDRESS, timeout_s: float = 5.0, token: str | None = None, by: str = ""
) -> Client:
    """Connect to the running daemon.

    Parameters
    ----------
    address : str or Path
        ``"host:port"``, or the path of the daemon's Unix socket. What reads or writes files of the daemon's computer
        (`Client.readings`, `Client.zero`, `Client.model`), and `Client.accept`, is allowed over the Unix socket alone.
    timeout_s : float
        For connecting, and for each answer and each setpoint, s.
    token : str, optional
        Over TCP, what is in the daemon's file `sockets.tcp.token_file`, where it has one.
    by : str
        For whom this client asks, one line of at most 200 characters: the daemon writes it to its log, and to
        recordings, with every order (`zero`, `accept`, `poll`, `model`, `release`).

    Returns
    -------
    Client
        A context manager that closes the connection.

    Raises
    ------
    DaemonError
        Where the address is none, no daemon answers there, it has too many clients, or it needs another token.

    Examples
    --------
    Watch the tip ten times a second::

        with compd.connect("127.0.0.1:7750") as daemon:
            for setpoint in daemon.watch(rate_hz=10):
                print(setpoint["tip_M_mm"] if setpoint["valid"] else setpoint["reason"])
    """
    connection = open_connection(str(address), timeout_s)
    try:
        return Client(connection, token, by)
    except DaemonError:
        connection.close()
        raise


class Client(ClientOrders):
    """A connection to the daemon, made by `connect`. Each method is named after the message that it is about.

    Messages are dictionaries with the keys of the protocol; lengths are in mm, angles in rad, times in s of the
    daemon's monotonic clock. A client is used by one thread. Setpoints that arrive while it waits for another answer
    are kept for `watch` and `latest`.

    Attributes
    ----------
    version : dict
        The daemon's VERSION message: `protocol`, `release`, `machine`, `config_hash`, `links`.
    """

    def __init__(self, connection: ClientConnection, token: str | None = None, by: str = "") -> None:
        """`connection`: to the daemon, with nothing read yet; `token`, `by`: as in `connect`."""
        super().__init__(by)
        self._connection = connection
        self._setpoints = ReadSetpoints(connection.same_clock)
        self._watches = False
        _, greeting = connection.read()
        if greeting["class"] == "AUTH":
            if token is None:
                raise DaemonError.of(
                    connection.address,
                    "the daemon wants a token before anything else",
                    next_step="give the one in its file `sockets.tcp.token_file`: connect(..., token=...), "
                    "`compd watch --token-file`",
                )
            greeting = self._ask({"class": "AUTH", "token": token.strip()}, "VERSION")
        self.version = greeting

    def watch(self, rate_hz: float | None = None) -> Iterator[Message]:
        """Iterate over SETPOINT messages, without end.

        `valid` is false in every message whose `state` this release does not know, whatever else it says: the daemon is
        a newer one then.

        Parameters
        ----------
        rate_hz : float, optional
            Setpoints per second; None for the setpoint of every cycle.

        Yields
        ------
        dict
            The message. A key whose value is not known is absent.

        Raises
        ------
        DaemonError
            Where the daemon has gone, or sent nothing within the timeout; or it refused a message that was sent
            meanwhile.
        """
        self._watch(rate_hz)
        while True:
            if not self._setpoints:
                self._await("SETPOINT")
            yield self._setpoints.next()

    def latest(self, timeout_s: float) -> Message:
        """Return the newest setpoint that may still be used: for a controller, which acts on no older one.

        Setpoints that came before it are read away. A valid one whose `valid_until` has passed is not returned; an
        invalid one is, since it says why there is no other. Each is returned once. The first call asks for the setpoint
        of every cycle, unless `watch` has asked for fewer.

        Parameters
        ----------
        timeout_s : float
            Longest wait for such a setpoint, s.

        Returns
        -------
        dict
            The message. A key whose value is not known is absent.

        Raises
        ------
        DaemonError
            Where no such setpoint came within the timeout, or the daemon has gone; or it refused a message that was
            sent meanwhile.
        """
        if not self._watches:
            self._watch()
        end_s = time.monotonic() + timeout_s
        while True:
            while self._connection.has_line(0.0):
                self._read()
            if (newest := self._setpoints.newest()) is not None:
                return newest
            left_s = end_s - time.monotonic()
            if left_s <= 0 or not self._connection.has_line(left_s):
                raise DaemonError.of(
                    self._connection.address,
                    "no setpoint that may still be used has come in time",
                    value=f"{timeout_s:g} s",
                    next_step="look at `compd status`; where the daemon is well, call `latest` more often",
                )

    def readings(self, rate_hz: float | None = None) -> Iterator[tuple[bytes, Message]]:
        """Iterate over what the cycles compute from, for a recording: each line as it came, and the message in it.

        The first item is the answer to WATCH, whose `columns` say which channel is which column of a recording. Then
        come READINGS messages, without end, just as the daemon sent them, and among them an ORDER for each order that
        a client gave. Unix socket only; use a connection for this alone.

        Parameters
        ----------
        rate_hz : float, optional
            Messages per second; None for one of every cycle.

        Yields
        ------
        bytes, dict
            The line, and the message in it.

        Raises
        ------
        DaemonError
            Where the daemon refuses, has gone, or sent nothing within the timeout.
        """
        request: Message = {"class": "WATCH", "what": "readings"}
        self._connection.send(request if rate_hz is None else request | {"rate_hz": rate_hz})
        while True:
            yield self._connection.read()

    def target(
        self,
        tip_B0_mm: Sequence[float] | None = None,
        rotation_B0_rad: Sequence[float] | None = None,
        tip_P_mm: Sequence[float] | None = None,
        time_s: float | None = None,
        id: int | None = None,
        tip_by_scale: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Set the tip's target, as the controller; the next setpoint is computed for it.

        The first client with a target is the controller until it disconnects or calls `release`. Of several targets
        that wait the newest counts. A target may be used for `sockets.target.valid_for_s` (5 s unless configured):
        repeat it more often than that, also while the machine stands still, or the setpoints become invalid. There is
        no answer: where the daemon refuses the target, the method that reads next raises DaemonError.

        Parameters
        ----------
        tip_B0_mm : three floats, optional
            The tip in {B0}, the base platform's frame at machine zero, mm.
        rotation_B0_rad : three floats, optional
            For a hexapod, the rotation vector of {P} in {B0}, rad; None for the attitude at machine zero.
        tip_P_mm : three floats, optional
            With the tool on the surface plate, instead of `tip_B0_mm`: the touched place in {P}, mm.
        time_s : float, optional
            When the target was made, s on the daemon's monotonic clock: on the same computer `time.monotonic()`. None
            for when it comes to the daemon, which is later where the network has stalled.
        id : int, optional
            Any number from 0 to 2**53: setpoints that answer the target have it as `target_id`.
        tip_by_scale : 3 or 6 rows of one number for each scale, optional
            With ``machine: external`` and scales: how much each scale moves the tip along x, y, z of {M}, mm per mm,
            and turns what carries it about them, rad per mm.

        Raises
        ------
        DaemonError
            Where the daemon has gone.
        """
        vectors = {"tip_B0_mm": tip_B0_mm, "rotation_B0_rad": rotation_B0_rad, "tip_P_mm": tip_P_mm}
        given: Message = {key: list(value) for key, value in vectors.items() if value is not None}
        given |= {key: value for key, value in (("time_s", time_s), ("id", id)) if value is not None}
        if tip_by_scale is not None:
            given["tip_by_scale"] = [list(row) for row in tip_by_scale]
        self._connection.send({"class": "TARGET", **given})

    def status(self) -> Message:
        """Ask for STATUS.

        Returns
        -------
        dict
            The state of the loop, its timing, every line and every gauge.

        Raises
        ------
        DaemonError
            Where the daemon has gone, or sent nothing within the timeout.
        """
        return self._ask({"class": "STATUS"}, "STATUS")

    def machine(self) -> Message:
        """Ask for MACHINE.

        Returns
        -------
        dict
            The machine's geometry, limits and wiring. They change only with `version["config_hash"]`.

        Raises
        ------
        DaemonError
            Where the daemon has gone, or is too old to know the request.
        """
        return self._ask({"class": "MACHINE"}, "MACHINE")

    def budget(self) -> Message:
        """Ask for BUDGET: how far each cause has moved the tip, by the newest setpoint.

        Returns
        -------
        dict
            `valid` and, where it is, `tip_um` (by cause, in x, y, z of {M}), `shadow_tip_um` where a shadow runs, and
            where the moving platform is.

        Raises
        ------
        DaemonError
            Where the daemon has gone, or is too old to know the request.
        """
        return self._ask({"class": "BUDGET"}, "BUDGET")

    def close(self) -> None:
        """Close the connection; a controller's role ends with it."""
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _ask(self, message: Message, answer: str, descriptor: int | None = None) -> Message:
        self._connection.send(message, descriptor)
        return self._await(answer)

    def _watch(self, rate_hz: float | None = None) -> None:
        self._ask({"class": "WATCH"} if rate_hz is None else {"class": "WATCH", "rate_hz": rate_hz}, "WATCH")
        self._watches = rate_hz != 0

    def _await(self, wanted: str) -> Message:
        """Read until a message of class `wanted`."""
        while (message := self._read())["class"] != wanted:
            pass
        return message

    def _read(self) -> Message:
        """Read a message; a setpoint is kept for `watch` and `latest`."""
        _, message = self._connection.read()
        if message["class"] == "SETPOINT":
            self._setpoints.put(message)
        return message
