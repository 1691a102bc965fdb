"""The page of the protocol: requests, messages, limits and the UDP packet, with examples from a running daemon."""

from __future__ import annotations

import inspect

from compd.live.loop.packet_layout import PACKET_FIELDS, PACKET_SIZE
from compd.live.service import PROTOCOL
from compd.live.service.client_session import MAX_BEHIND_BYTES, MAX_READINGS_BEHIND_BYTES
from compd.live.service.connection_limits import AUTH_WITHIN_S, IDLE_AFTER_S, MAX_CLIENTS, MAX_TCP_CLIENTS
from compd.live.service.message_keys.message import ErrorKeys, SentMessage, VersionKeys
from compd.live.service.message_keys.readings import ReadingsKeys
from compd.live.service.message_keys.setpoint import SetpointKeys
from compd.live.service.message_keys.status import StatusKeys
from compd.live.service.messages import MAX_LINE_BYTES, MAX_NUMBER, ErrorCode
from compd.live.service.order import OrderKeys
from compd.live.service.request import Asker, Request
from compd.live.service.requests import REQUESTS
from compd.operation_settings import TargetSettings, TcpSocket
from compd.setpoint_states import Mode
from docs.generate.live_examples import Exchange, exchanges, shown
from docs.generate.markdown import code, escape, fence, heading, join, link, prose, table, target, term
from docs.generate.schema import Key, ModelSchema

# Messages that the daemon sends, in the order of the page, with those keys of an example that are not shown in full.
SENT: dict[type[SentMessage], tuple[str, ...]] = {
    SetpointKeys: (),
    ReadingsKeys: ("carried", "setpoint"),
    OrderKeys: (),
    StatusKeys: (),
    VersionKeys: (),
    ErrorKeys: (),
}
_C_TYPES = {"s": "uint8_t", "x": "uint8_t", "B": "uint8_t", "H": "uint16_t", "I": "uint32_t", "Q": "uint64_t"}
_C_TYPES |= {"q": "int64_t", "d": "double"}
_NAMES_OF_TYPES = {"s": "bytes", "x": "bytes", "B": "uint8", "H": "uint16", "I": "uint32", "Q": "uint64"}
_NAMES_OF_TYPES |= {"q": "int64", "d": "float64"}

INTRODUCTION = f"""\
The daemon listens on TCP ({TcpSocket().host}:{TcpSocket().port} unless [configured](#configuration-sockets) otherwise)
and on a Unix socket (`sockets.unix.path`). Both speak the same protocol, version {PROTOCOL}: one JSON object per line,
UTF-8, ended by `\\n`. An empty line is ignored; an object in which a key stands twice is an error. Every message has
its name under the key `class`. Any language that opens a socket and reads JSON
will do; in Python, [`compd.client`](python.md) does it for you.
[Connect a controller](../how-to/connect-a-controller.md) goes from the first line to the corrected drive command.

Lengths are in mm, angles in radians, times in seconds on the daemon's monotonic clock (`CLOCK_MONOTONIC`, in Python
`time.monotonic()`). The letters before a unit are the frame of a vector: `M` is the surface plate, `B` the base
platform, `B0` the base platform at {term("machine zero")}, `P` the moving platform.
"""
RULES = f"""\
**Absent means unknown.** There is no `null` and no NaN. A key without a value is left out.

**Ignore keys that you do not know.** Later releases add some. In what *you* send, an unknown key is an error.

**Treat an unknown state as invalid.** A [state](states.md), or in a packet a code, that you do not know comes from a
newer daemon: use nothing of that setpoint.

**Enforce expiry yourself.** Do not use a {term("setpoint")} later than its `valid_until`. On the daemon's computer
compare it with `CLOCK_MONOTONIC`. On another computer, whose clock is not that one, use the setpoint for `valid_until -
time_s` seconds from the moment of its arrival. That the loop has stopped you are told, by a `stop`; that the whole
daemon, its computer or the network has, nobody can tell you.

**Connect again.** When the daemon ends, or takes another configuration, it holds the correction for 0.2 s, sends a last
setpoint, `stop`, and closes the connection ([the daemon's processes](../explanation/processes.md#stop-and-reload)).

**Keep up.** The daemon waits for no client. It disconnects one that is {MAX_BEHIND_BYTES // 1024} KiB behind,
{MAX_READINGS_BEHIND_BYTES // 1024**2} MiB while it watches readings.

**One client is the controller:** the first that sends a valid `TARGET`, until it sends `RELEASE`, a client of the Unix
socket does, or its connection ends. The mode then returns to `{Mode.CMM}`.

**Repeat the target.** It grows old: `{TargetSettings().valid_for_s:g} s` after the last `TARGET`, unless
[configured](#configuration-sockets-target) otherwise, setpoints are invalid (`stop`) until the next one comes.

**Wait your turn.** The daemon answers one request of each client in turn, the controller's first, and sends setpoints
before them: who asks without end waits for the answers, and delays nobody else's setpoints.

**Show the token first** where one is [configured](#configuration-sockets-tcp): a TCP client is then greeted by `AUTH`
in place of `VERSION`.

**Answers come in the order of the questions**, except `ZERO`, `MODEL` that changes models, and setpoints, which come
when they
are there. A message that cannot be followed is answered by [`ERROR`](#protocol-error), and the connection stays.
"""
PACKET = f"""\
With [`sockets.udp`](#configuration-sockets-udp) every setpoint also goes as a UDP packet of {PACKET_SIZE} bytes to the
controller: little-endian, IEEE 754 numbers. It is sent without waiting: a packet that the network does not take at once
is dropped, and counted in [`STATUS`](#protocol-status).

Links that the machine does not have are nan. When the setpoint is invalid, every number of the tip, the frame and the
links is nan.

A field is never moved. A new field comes with another version and size: refuse a packet whose version or size you do
not know. Packets of releases up to 0.3.0 have version 1 and 276 bytes, without the target.
"""


def page() -> str:
    """Markdown, from the classes of the requests and the models of the messages."""
    greeting = exchanges()["greeting"].received[0]
    return join(
        "# Protocol",
        INTRODUCTION,
        "A daemon on the simulated tripod sends this as soon as a client connects:",
        fence(shown(greeting), "json"),
        "## Rules for clients",
        RULES,
        "## What a client sends",
        table(["message", "who may send it", "answer"], [_request_row(kind) for kind in REQUESTS.values()]),
        *(_request(kind) for kind in REQUESTS.values()),
        "## What the daemon sends",
        table(["message", "when"], [[_link(kind), escape(_first_line(kind))] for kind in SENT]),
        *(_sent(kind, left_out) for kind, left_out in SENT.items()),
        heading(2, "SETPOINT as a UDP packet", "protocol-packet"),
        PACKET,
        table(["offset", "type", "field", "meaning"], packet_rows()),
        "As a structure in C:",
        fence(c_struct(), "c"),
        "## Limits",
        table(
            ["limit", "value"],
            [
                ["length of a line that a client sends", f"{MAX_LINE_BYTES} bytes, without its newline"],
                ["absolute value of a number that a client sends", f"{MAX_NUMBER:g}"],
                ["clients at once", f"{MAX_CLIENTS}, of which {MAX_TCP_CLIENTS} over TCP"],
                [
                    "TCP client that neither watches, nor asks, nor is the controller",
                    f"{IDLE_AFTER_S:g} s, then closed",
                ],
                ["TCP client that has to show a token", f"{AUTH_WITHIN_S:g} s, then closed"],
                ["unsent bytes, setpoints", f"{MAX_BEHIND_BYTES} bytes"],
                ["unsent bytes, readings", f"{MAX_READINGS_BEHIND_BYTES} bytes"],
            ],
        ),
    )


def keys_table(keys: list[Key], absent: str = "; may be absent") -> str:
    """Keys of a message: name, type, meaning. `absent` follows the type of a key that may be left out."""
    return table(
        ["key", "value", "meaning"],
        [[code(key.name), key.type_text + ("" if key.needed else absent), key.meaning] for key in keys],
    )


def packet_rows() -> list[list[str]]:
    """Offset, type, name and meaning of every field of the packet."""
    rows, offset = [], 0
    for field in PACKET_FIELDS:
        kind = _NAMES_OF_TYPES[field.format[-1]]
        rows.append([str(offset), f"{field.format[:-1]} {kind}".strip(), code(field.name), escape(field.meaning)])
        offset += field.size
    return rows


def c_struct() -> str:
    """The packet as a structure in C."""
    members = []
    for field in PACKET_FIELDS:
        count = f"[{field.format[:-1]}]" if field.format[:-1] else ""
        members.append(f"    {_C_TYPES[field.format[-1]]} {field.name}{count};\n")
    return f"struct __attribute__((packed)) setpoint {{\n{''.join(members)}}};  /* {PACKET_SIZE} bytes */"


def _link(kind: type[SentMessage]) -> str:
    return link(code(kind.wire_name), target("protocol", kind.wire_name))


def _first_line(kind: type[object]) -> str:
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def _request_row(kind: type[Request]) -> list[str]:
    message = link(code(kind.wire_name), target("protocol", "send", kind.wire_name))
    if kind.reply is None:
        return [message, kind.asker.value, "none"]
    return [message, kind.asker.value, _link(kind.reply) if kind.reply in SENT else code(kind.reply.wire_name)]


def _request(kind: type[Request]) -> str:
    """One request: what it is for, its keys, its answer's keys, an example."""
    name = kind.wire_name
    schema = ModelSchema(kind)
    blocks = [heading(3, code(name), target("protocol", "send", name)), prose(inspect.getdoc(kind) or "")]
    if kind.asker is not Asker.ANYBODY:
        refused = ErrorCode.UNIX_ONLY if kind.asker is Asker.LOCAL else ErrorCode.NOT_CONTROLLER
        blocks.append(f"Any other client gets the error {code(refused)}: {escape(kind.refusal)}.")
    if keys := schema.keys():
        blocks.append(keys_table(keys, "; may be left out"))
    if kind.reply is not None and kind.reply not in SENT and (answer := ModelSchema(kind.reply).keys()):
        blocks += [f"Keys of the answer {code(kind.reply.wire_name)}:", _all_keys(kind.reply, "send", answer)]
    exchange = exchanges()[name]
    if kind.reply in SENT:
        blocks.append(f"The answer is {_link(kind.reply)}.")
        exchange = exchange._replace(received=())
    return join(*blocks, _example(exchange))


def _sent(kind: type[SentMessage], left_out: tuple[str, ...]) -> str:
    """One message from the daemon: what it is, its keys, what is nested in it, an example."""
    name = kind.wire_name
    blocks = [heading(3, code(name), target("protocol", name)), prose(inspect.getdoc(kind) or "")]
    blocks.append(_all_keys(kind, "", ModelSchema(kind).keys()))
    if kind is SetpointKeys:
        blocks += ["The [states](states.md) have a page of their own. The modes:"]
        blocks.append(table(["mode", "code", "meaning"], [[code(m), str(m.code), escape(m.text)] for m in Mode]))
    if kind is ErrorKeys:
        blocks.append(table(["code", "when"], [[code(error), escape(error.text)] for error in ErrorCode]))
    return join(*blocks, _example(exchanges()[name], left_out))


def _all_keys(kind: type[SentMessage], prefix: str, keys: list[Key]) -> str:
    """The keys of a message, and below them those of each part that is nested in it."""
    where = target("protocol", prefix, kind.wire_name)
    schema = ModelSchema(kind, lambda model: link(_part_name(model), f"{where}-{model.lower()}"))
    blocks = [keys_table(schema.keys())] if keys else []
    for model, definition in schema.definitions.items():
        if "properties" in definition:
            blocks += [
                f"({where}-{model.lower()})=\n**{_part_name(model).capitalize()}.** "
                + escape(definition["description"]),
                keys_table(schema.keys(model)),
            ]
    return join(*blocks)


def _part_name(model: str) -> str:
    """`GaugePollsKeys` -> "gauge polls"."""
    words = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in model.removesuffix("Keys"))
    return words.strip()


def _example(exchange: Exchange, left_out: tuple[str, ...] = ()) -> str:
    """What was sent and what came, as one block each."""
    blocks = []
    if exchange.sent is not None:
        blocks += ["For example, a client sends", fence(shown(exchange.sent), "json")]
    if exchange.received:
        blocks.append("and the daemon" if exchange.sent else "For example:")
        blocks += [fence(shown(message, left_out), "json") for message in exchange.received]
    return join(*blocks)
