"""The keys of MACHINE: geometry, limits and wiring."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from compd.live.service.message_keys.message import Keys, SentMessage
from compd.operation_settings import LimitSettings, LoopBasics


class WiredChannelKeys(Keys):
    """What one channel measures."""

    kind: Literal["scale", "joint", "frame", "quantity"] = Field(description="of what is measured")
    channel: str = Field(description='"gauge.channel", as in READINGS and STATUS')
    sign: Literal[1, -1] = Field(description="-1 where the display falls as the length grows")
    stale_after_s: float = Field(description="a reading older than this is stale, s")
    link: int | None = Field(default=None, description="of a scale or a joint: the link, counted from 1")
    role: Literal["S", "Ra", "Rb", "B"] | None = Field(default=None, description="of a joint, as in the configuration")
    distance: str | None = Field(default=None, description="of the frame: t1 to t3, u1 to u6")
    name: str | None = Field(default=None, description="of a quantity, with its unit")


class MachineKeys(SentMessage):
    """Answers MACHINE: what a client needs to draw the machine and to know its limits."""

    wire_name = "MACHINE"
    machine: str = Field(description="the machine's name in the configuration")
    config_hash: str = Field(description="hash of the whole configuration, hexadecimal; another one: ask again")
    geometry: dict[str, Any] = Field(
        description="the section `geometry` of the configuration, with the same keys; of own kinematics the class alone"
    )
    mechanism: dict[str, Any] | None = Field(
        default=None,
        description="`actuators`, `rods`, `hinges` and `target_fixes` of the machine, also where `geometry` has the "
        "keys of `kinematics`; absent with own kinematics",
    )
    limits: LimitSettings = Field(description="what a correction may be")
    loop: LoopBasics = Field(description="how the loop runs")
    wiring: list[WiredChannelKeys] = Field(description="what each channel measures: scales, joints, frame, quantities")
