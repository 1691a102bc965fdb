"""The events that the daemon logs: one list, of which the log, the journal's fields and the reference are made.

Where something happens, it is logged by the words for people: `log.warning("line is lost", line=..., detail=...)`.
`name_event` adds the name for programs, which stays the same when the words are improved: `id=line_lost`.
A test holds every call in the daemon against this list.
"""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping
from typing import Any, NamedTuple


class Event(NamedTuple):
    """One kind of event.

    id : name for programs. text : what the log says. level : the highest that it is logged with.
    keys : what it carries. meaning : when it comes.
    """

    id: str
    text: str
    level: str
    keys: tuple[str, ...]
    meaning: str


# The keys of all events, and what they mean.
KEYS: Mapping[str, str] = {
    "by": "for whom a client asks, as it says; or the client that has taken the role",
    "changed_mm": "by how much the gauges differ from the machine zero before",
    "channels": "channels that are believed again",
    "not_believed": "channels that are not believed after it either, each with the reason",
    "change": "what has changed",
    "check": "how the process that checked the configuration has ended",
    "channel": "`gauge.channel`",
    "client": "address of the client, or `unix` and the number of its user",
    "config_hash": "hash of the configuration",
    "cost_s": "what one request takes from the others on its line, s",
    "count": "how many",
    "detail": "what the device sent or the line saw",
    "effects": "ids of the effects of a model",
    "error": "what went wrong, in the words of the system or of Python",
    "evidence": "what the other gauges say of it",
    "file": "path of a model file; `none` for the machine without effects",
    "gauge": "name of the gauge in the configuration",
    "hash": "hash of a model file",
    "how": "how a process has ended",
    "line": "name of the line in the configuration",
    "lines": "names of lines",
    "machine": "name of the machine",
    "mode": "`cmm` or `machine_tool`",
    "order": "class of the request",
    "path": "path of a file",
    "peer": "address and port of a device",
    "port": "the port's device",
    "problem": "one problem of the configuration, with its place and what to do",
    "process": "name of a process of the daemon",
    "quality": "quality of the gauge's last poll",
    "rate_hz": "cycles per second",
    "quantities": "names of temperatures, forces and so on",
    "reason": "why, in words",
    "rest_s": "until the gauge is asked again, s",
    "signal": "name of the signal",
    "source": "name of the process that prints",
    "state": "state of the setpoints, see `states`",
    "subject": "what an order is about: a gauge, a model file",
    "taken_at": "when machine zero was taken, UTC",
    "tcp_port": "TCP port on which the daemon listens",
    "unix": "path of the Unix socket",
    "was": "quality before",
    "what": "what is probably a mistake",
    "where": "file, line and key",
}

EVENTS: tuple[Event, ...] = (
    Event("running", "running", "info", ("machine", "config_hash", "rate_hz", "unix", "tcp_port"),
          "the daemon is about to start its processes"),
    Event("configuration_warning", "configuration", "warning", ("where", "what"),
          "at the start, for each warning of `compd check`"),
    Event("configuration_problem", "configuration refused", "error", ("problem",),
          "at SIGHUP, for each problem of the new configuration"),
    Event("reload_refused", "the configuration is refused, the daemon goes on with its own", "error", ("check",),
          "after SIGHUP with a configuration that cannot be used"),
    Event("stopping", "stopping", "info", ("signal",), "the daemon has got SIGTERM or SIGINT"),
    Event("state", "state", "warning", ("state", "reason", "mode"),
          "the state of the setpoints has changed; a warning where they are not valid"),
    Event("gauge_quality", "gauge", "warning", ("gauge", "quality", "was", "detail"),
          "the quality of a gauge has changed; a warning unless it is `ok` again"),
    Event("gauge_absent", "gauge is polled seldom", "warning", ("gauge", "cost_s", "rest_s"),
          "it does not answer, and the others on its line go stale when it is asked; `compd gauge poll` asks it"),
    Event("driver_failed", "driver failed", "error", ("gauge",),
          "a driver has raised an exception, for the first time; its traceback follows"),
    Event("source_clock", "clock of a source", "warning", ("gauge", "detail"),
          "the time that a device sends is in the future, so that the time of arrival counts; or it is right again"),
    Event("line_open", "line is open", "info", ("line",), "a line has been opened, also after it was lost"),
    Event("line_lost", "line is lost", "warning", ("line", "detail"), "a port is gone, or the other end has closed"),
    Event("line_shares_device", "lines share a device", "warning", ("line", "lines", "peer"),
          "a Modbus TCP line is connected to the address and port of another: their units wait for each other"),
    Event("line_failed", "line failed", "error", ("line",),
          "opening or polling a line has raised what it should not; its traceback follows, the line is lost"),
    Event("line_close_failed", "a line did not close cleanly", "info", ("line", "reason"), "when a line is lost"),
    Event("gauge_warning", "gauge is to be inspected", "warning", ("channel", "reason"),
          "a gauge that is believed steps or scatters as it should not"),
    Event("gauge_warning_over", "gauge has no warning any more", "info", ("channel", "reason"),
          "what it was warned of is over, or it is not believed any more"),
    Event("gauge_contradicted", "gauge is contradicted", "warning", ("channel", "evidence"),
          "a vote of other gauges; it is not believed before `compd accept`"),
    Event("gauge_at_another_port", "gauge is at another port", "warning", ("gauge", "change"),
          "a new configuration has another port for its line; it is not believed before `compd accept`"),
    Event("last_readings_unreadable", "last readings cannot be read", "warning", ("path", "reason"),
          "at the start: the gauges are compared with nothing"),
    Event("last_readings_damaged", "last readings are damaged", "warning", ("path", "reason"),
          "at the start: the gauges are compared with nothing"),
    Event("last_readings_unwritable", "last readings cannot be written", "warning", ("path", "reason"),
          "the disk refuses; the next start will compare with older readings"),
    Event("lines_busy", "lines still busy", "warning", ("lines",), "at the end: drivers that do not return"),
    Event("zero_loaded", "machine zero", "info", ("taken_at",), "at the start: machine zero is on the disk"),
    Event("zero_at_another_port", "machine zero was taken at another port", "warning", ("gauge", "change"),
          "at the start: machine zero fits, if the same gauge is at that port"),
    Event("zero_missing", "no machine zero", "warning", ("reason",), "at the start: there is none that fits"),
    Event("zero_taken", "machine zero taken", "info", ("path", "changed_mm"), "`compd zero` has succeeded"),
    Event("zero_differs", "machine zero differs", "warning", ("reason",),
          "`compd zero` asks: a gauge is far from the machine zero until now, or not believed"),
    Event("zero_given_up", "machine zero is still being taken, and is given up", "warning", (),
          "at the end of the daemon"),
    Event("zero_refused", "machine zero refused", "warning", ("reason",), "`compd zero` has failed"),
    Event("model_loaded", "model", "info", ("file", "hash", "effects"), "at the start, with `state.model_file`"),
    Event("model_file_warning", "model file", "warning", ("reason",),
          "at the start: what the file does not say of itself"),
    Event("zero_without_checksum", "machine zero has no checksum: what was changed in it cannot be seen", "warning",
          ("path",), "at the start, with a file of a release up to 0.2"),
    Event("last_readings_without_checksum", "last readings have no checksum: what was changed in them cannot be seen",
          "warning", ("path",), "at the start, with a file of a release up to 0.2"),
    Event("model_of_old_datum", "effects count from 20 degC and not from machine zero", "warning", ("file", "effects"),
          "a model was fitted without the quantities at machine zero: fit it again, on a recording with them"),
    Event("zero_incomplete", "machine zero is without quantities that could not be read", "warning", ("quantities",),
          "`compd zero`: models with effects of these quantities are refused until zero is taken with them"),
    Event("model_adopted", "model adopted", "info", ("file",), "`compd model adopt` has succeeded"),
    Event("shadow_adopted", "shadow", "info", ("file",), "`compd model shadow` has succeeded"),
    Event("model_refused", "model refused", "error", ("file", "reason"), "a model cannot be used; nothing has changed"),
    Event("client_dropped", "slow client dropped", "warning", ("client",), "a client did not take what it asked for"),
    Event("client_refused", "a client could not be accepted", "warning", ("error",),
          "the system has no room for another connection"),
    Event("client_not_allowed", "a client is not allowed", "warning", ("client",),
          "its address is not in `sockets.tcp.allow`; it was not connected"),
    Event("client_not_authorized", "a client has not shown the token", "warning", ("client", "reason"),
          "its first line was not `AUTH` with the token"),
    Event("client_lost_place", "client dropped", "warning", ("client", "reason"),
          "over TCP: idle for a minute, or without the token"),
    Event("controller", "controller", "info", ("client",), "a client has become the controller by its first `TARGET`"),
    Event("controller_gone", "no controller any more", "info", ("client",), "its role has ended: the mode is `cmm`"),
    Event("controller_ousted", "the controller has lost its role", "warning", ("client", "by"),
          "a client of the Unix socket has taken the role from it: `compd machine release`"),
    Event("poll_requested", "poll requested", "info", ("gauge", "client"),
          "`compd gauge poll`: a gauge that is asked seldom is asked at once"),
    Event("gauges_accepted", "gauges accepted", "warning", ("gauge", "channels", "not_believed"),
          "`compd accept`: a person has looked at them, and they are believed again"),
    Event("order_done", "order done", "info", ("order", "subject", "client", "by"),
          "what a client ordered (`ZERO`, `ACCEPT`, `POLL`, `MODEL`, `RELEASE`) is done"),
    Event("order_refused", "order refused", "warning", ("order", "subject", "client", "by", "reason"),
          "what a client ordered is not done, and nothing has changed"),
    Event("loop_ended", "the loop has ended", "error", ("how",), "another loop takes over"),
    Event("cycle_not_repeated", "the last cycle cannot be computed again", "warning", ("error",),
          "a loop that takes over begins anew, from the correction that is applied"),
    Event("process_ended", "a process has ended and starts anew", "error", ("process", "how"),
          "of the acquisition, or of a line of its own"),
    Event("service_ended", "the service has ended, and with it the daemon", "error", ("how",),
          "the service manager starts the daemon again"),
    Event("process_killed", "a process had to be killed", "warning", ("process",), "at the end of the daemon"),
    Event("log_dropped", "log lines dropped", "warning", ("source", "count"), "a process prints too much"),
    Event("control_lines_refused", "DTR, RTS or RS-485 not granted", "warning", ("port", "reason"),
          "the port does not have what `dtr`, `rts` or `rs485` of its line sets"),
    Event("port_close_failed", "a lost port did not close cleanly", "info", ("reason",), "when a line is lost"),
)  # fmt: skip

_ID_OF_TEXT = {event.text: event.id for event in EVENTS}


def name_event(_logger: Any, _method: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Add the name for programs to an event; a processor of structlog."""
    if (name := _ID_OF_TEXT.get(event.get("event", ""))) is not None:
        event["id"] = name
    return event
