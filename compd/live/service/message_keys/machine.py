"""The keys of MACHINE: geometry, limits and wiring."""

from __future__ import annotations

from typing import Any, Literal

from compd.live.service.message_keys.message import Keys, SentMessage, absent, present
from compd.operation_settings import LimitSettings, LoopBasics


class WiredChannelKeys(Keys):
    """What one channel measures."""

    kind: Literal["scale", "joint", "frame", "quantity"] = present("of what is measured")
    channel: str = present('"gauge.channel", as in READINGS and STATUS')
    sign: Literal[1, -1] = present("-1 where the display falls as the length grows")
    stale_after_s: float = present("a reading older than this is stale, s")
    link: int | None = absent("of a scale or a joint: the link, counted from 1")
    role: Literal["S", "Ra", "Rb", "B"] | None = absent("of a joint, as in the configuration")
    distance: str | None = absent("of the frame: t1 to t3, u1 to u6")
    name: str | None = absent("of a quantity, with its unit")


class MachineKeys(SentMessage):
    """Answers MACHINE: what a client needs to draw the machine and to know its limits."""

    wire_name = "MACHINE"
    machine: str = present("the machine's name in the configuration")
    config_hash: str = present("hash of the whole configuration, hexadecimal; another one: ask again")
    geometry: dict[str, Any] = present(
        "the section `geometry` of the configuration, with the same keys; of own kinematics the class alone"
    )
    mechanism: dict[str, Any] | None = absent(
        "`actuators`, `rods`, `hinges` and `target_fixes` of the machine, also where `geometry` has the keys of "
        "`kinematics`; absent with own kinematics"
    )
    limits: LimitSettings = present("what a correction may be")
    loop: LoopBasics = present("how the loop runs")
    wiring: list[WiredChannelKeys] = present("what each channel measures: scales, joints, frame, quantities")
