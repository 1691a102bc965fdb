"""The keys of MACHINE: geometry, limits and wiring."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from compd.live.service.message_keys.message import Keys, SentMessage


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


class MachineLoopKeys(Keys):
    """The loop, as in the section `loop` of the configuration."""

    rate_hz: float = Field(description="cycles per second")
    stale_after_s: float = Field(description="a reading older than this is stale, unless its gauge says otherwise, s")
    on_stale: Literal["hold", "fade", "degrade", "stop"] = Field(description="what happens without a comparator")
    hold_s: float = Field(description="for how long at most, s")


class MachineLimitKeys(Keys):
    """Of the correction of each link, as in the section `limits` of the configuration."""

    correction_mm: float = Field(description="largest, to either side, mm")
    slew_mm_per_s: float = Field(description="fastest change, mm/s")
    on_limit: Literal["clamp", "refuse"] = Field(description="what happens beyond them")
    tip_correction_mm: float | None = Field(
        default=None, description="machines without scales: largest of the tip, mm; absent: `correction_mm`"
    )
    rotation_correction_rad: float | None = Field(
        default=None,
        description="machines without scales: largest of the attitude, rad; absent: as the tip's at 100 mm",
    )
    tip_error_um: float | None = Field(
        default=None, description="largest bound of the tip's error that is valid, um; absent: none"
    )


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
    limits: MachineLimitKeys = Field(description="what a correction may be")
    loop: MachineLoopKeys = Field(description="how the loop runs")
    wiring: list[WiredChannelKeys] = Field(description="what each channel measures: scales, joints, frame, quantities")
