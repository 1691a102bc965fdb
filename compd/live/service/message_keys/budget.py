"""The keys of BUDGET: how far each cause has moved the tip."""

from __future__ import annotations

from compd.live.service.message_keys.message import Keys, SentMessage, Vector, absent, present
from compd.setpoint_states import State


class PlatformKeys(Keys):
    """The moving platform."""

    origin_M_mm: Vector = present("origin of {P} in {M}, mm")
    rotation_M_rad: Vector = present("rotation vector of {P} in {M}, rad")
    joints_M_mm: list[Vector] = present("the platform joint of each link, in {M}, mm")


class BudgetKeys(SentMessage):
    """Answers BUDGET. Where `valid` is false there is no number."""

    wire_name = "BUDGET"
    valid: bool = present("whether the newest setpoint is")
    reason: str = present('why its state is not `ok`; "" when it is')
    seq: int | None = absent("number of the cycle; absent before the first")
    time_s: float | None = absent("of the setpoint, s on the daemon's monotonic clock")
    state: State | None = absent("of the setpoint")
    tip_um: dict[str, Vector] | None = absent(
        "how far each cause has moved the tip, in x, y, z of {M}, um: `joints`, `frame`, then each effect by its id; "
        "to first order, before the limits. With the tool on the plate: the touched place, in {P}"
    )
    shadow_tip_um: Vector | None = absent(
        "how far the shadow model has all causes together move the tip, um: beside the sum of `tip_um`; absent without "
        "a shadow, and while it has no numbers"
    )
    supports_M_mm: list[Vector] | None = absent("b1, b2, b3 of the base platform, in {M}, mm")
    supports_moved_um: list[Vector] | None = absent("how far since machine zero, um")
    base_joints_M_mm: list[Vector] | None = absent("the base joint of each link, in {M}, mm")
    platform: PlatformKeys | None = absent("where the moving platform is")
