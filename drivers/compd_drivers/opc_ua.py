"""OPC UA gauge: numbers in nodes of a server, such as a PLC or a measuring system.

    gauges:
      joint_1:
        driver: opc_ua
        line: plc
        channels: [{name: value, node: "ns=2;s=Probe1", unit: um, range: [-1, 1]}]   # the range is in mm

A node is named by its id, with the index of its namespace (`ns=2;s=Probe1`), or with its name, which stays the same
when the server is configured anew (`nsu=http://maker.example/probes;s=Probe1`). The value is any number of OPC UA, or,
with `index`, an entry of an array of numbers. Text, true and an array without `index` are `mismatch`.

A value counts where its status is Good. The others have qualities (`compd.lines.kinds.opc_ua.status`) and the name of
the status as their detail: BadSensorFailure is `sensor_fault`, UncertainLastUsableValue `stale`, a value at the limit
of its range `over_range` or `under_range`, most others `device_error`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from compd.gauge import Channel, GaugeOptions, LineFault, LineKind, OptionDoubt, Quality, Reading
from compd.pushed_gauge import Message, PushedGauge, PushedGaugeOptions
from compd_drivers.measured import RANGE_OPTION, MeasuredChannel, doubts, repeated
from compd_drivers.no_number import FULL_SCALE

_NODE = r"^((ns=[0-9]+|nsu=[^;]+);)?([is]=.+|[gb]=\S+)$"
SHOWN = 60  # characters of a value that is no number


class OpcUaChannel(MeasuredChannel):
    """One value: a node, or an entry of an array node."""

    node: str = Field(pattern=_NODE, description="its id: ns=2;s=NAME, ns=2;i=NUMBER, nsu=NAMESPACE;s=NAME")
    index: int | None = Field(default=None, ge=0, description="entry of an array, from 0; left out: it is one number")


class OpcUaOptions(PushedGaugeOptions):
    """Options of an OPC UA gauge."""

    channels: tuple[OpcUaChannel, ...] = Field(min_length=1, description="the values, each with its node")

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        if doubled := repeated([channel.name for channel in self.channels]):
            raise ValueError(f"channel named twice: {doubled}")
        return self


class OpcUa(PushedGauge):
    """Numbers in nodes of an OPC UA server, by a subscription."""

    Options: ClassVar[type[GaugeOptions]] = OpcUaOptions
    line_kind: ClassVar[LineKind] = "nodes"
    range_option: ClassVar[str] = RANGE_OPTION
    sample_options: ClassVar[Mapping[str, Any]] = {
        "channels": [
            {"name": "value", "node": "nsu=http://maker.example/probes;s=Probe1", "unit": "um", "range": [-1, 1]}
        ]
    }
    silence_hint = "where the server sends only what changes, write `unchanged: holds` on the line"

    def __init__(self, options: OpcUaOptions) -> None:
        self._described = options.channels
        super().__init__(options)

    @property
    def channels(self) -> Sequence[Channel]:
        return [described.channel for described in self._described]

    def doubts(self) -> Iterable[OptionDoubt]:
        return doubts(self._described, self.range_option)

    @property
    def addresses(self) -> Sequence[str]:
        return [described.node for described in self._described]

    def decode(self, index: int, message: Message, time_s: float) -> Reading:
        described = self._described[index]
        value: Any = message.payload
        if described.index is not None:
            if not isinstance(value, list) or described.index >= len(value):
                raise LineFault(Quality.MISMATCH, f"no entry {described.index} in {value!r}"[:SHOWN])
            value = value[described.index]
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise LineFault(Quality.MISMATCH, f"no number: {type(value).__name__} {value!r}"[:SHOWN])
        words = FULL_SCALE if isinstance(value, int) else ()
        return described.reading(float(value), time_s, full_scale=words)
