"""The keys of SETPOINT, the result of one cycle."""

from __future__ import annotations

from compd.live.service.message_keys.message import Keys, Links, SentMessage, Vector, absent, present
from compd.setpoint_states import Mode, State


class FrameKeys(Keys):
    """The frame of the base platform, {B}."""

    origin_M_mm: Vector = present("its origin in {M}, mm")
    displacement_M_mm: Vector = present("displacement of its origin since machine zero, in {M}, mm")
    rotation_M_rad: Vector = present("its rotation since machine zero, as a rotation vector in {M}, rad")


class ShadowKeys(Keys):
    """What the shadow model asks for in this cycle. Nothing of it is applied."""

    model: str = present("hash of its file")
    reason: str = present('why it has no numbers; "" when it has')
    correction_mm: Links | None = absent("correction of each link before limits, mm")
    tip_M_mm: Vector | None = absent("the tip in {M}, mm")
    tip_P_mm: Vector | None = absent("tool on the plate: the touched place in {P}, mm")


class SetpointKeys(SentMessage):
    """The result of one cycle. Where `valid` is false, no key is there that holds a value a controller could use.

    In mode `cmm` the uncompensated command is what the scales show, and `correction_mm` is what would have to be added
    to bring the tip to where the scales alone believe it to be. While a correction is clamped or slews to that of a
    newly adopted model, the tip in mode `cmm` is the one that belongs to the correction which is applied.

    While setpoints are invalid the last correction is remembered, and the next valid one slews from it: hold your last
    command meanwhile.
    """

    wire_name = "SETPOINT"
    seq: int = present(
        "number of the cycle, which rises by one per period; a gap is a missed cycle, a lower rate or a dropped message"
    )
    time_s: float = present("when the gauges were looked at, s on the daemon's monotonic clock")
    valid: bool = present("false: use nothing of this message; from `tip_M_mm` on every key is absent")
    state: State = present("how the setpoint came about")
    reason: str = present('why the state is not `ok`, for a person; "" when it is')
    valid_until: float = present("not to be used later than this, s; `time_s` itself when it is not valid")
    mode: Mode = present("cmm: the scales say where the tip is; machine_tool: a `TARGET` does")
    target_time_s: float | None = absent(
        "mode machine_tool: when the target that it answers was made, s on the daemon's monotonic clock; where "
        "`TARGET` does not say, when it came"
    )
    target_id: int | None = absent("`id` of that target, where it has one")
    model: str | None = absent("hash of the model file that is applied; absent without effects")
    age_s: float | None = absent("age of the oldest reading used, s")
    skew_s: float | None = absent(
        "how much later than the oldest the newest length that was used was measured, s; absent where none was. "
        "`loop.skew_s` limits it"
    )
    tip_M_mm: Vector | None = absent(
        "the tip in {M}, the surface plate, mm; in mode cmm measured, in mode machine_tool the target, which is "
        "reached in state ok"
    )
    tip_B0_mm: Vector | None = absent("the tip in {B0}, the base platform at machine zero, mm")
    tip_P_mm: Vector | None = absent("tool on the plate: the touched place in {P}, mm")
    rotation_M_rad: Vector | None = absent(
        "machines without scales, and `machine: external`: attitude of what carries the tip, as a rotation vector in "
        "{M}, rad; it belongs to `tip_M_mm`, and is absent where it is not known"
    )
    tip_correction_mm: Vector | None = absent(
        "machines without scales, and `machine: external`: what to add to the tip that is commanded, in {B0}, mm, "
        "within its limits: `tip_B0_mm` of the target plus this, sent to the drives, brings the tip to the target"
    )
    rotation_correction_rad: Vector | None = absent(
        "the same for the attitude that is commanded: a small turn about the axes of {B0} that follows it, as a "
        "rotation vector, rad; absent where the attitude is not known"
    )
    own_columns: dict[str, float] | None = absent(
        "`machine: external` with a class: what its method `columns` gives, by name, for effects and recordings"
    )
    frame: FrameKeys | None = absent("where the base platform is, and how it has moved")
    link_length_mm: Links | None = absent("length of each link, mm: measured (cmm) or needed (machine_tool)")
    scale_setpoint_mm: Links | None = absent(
        "what each scale is to show, from machine zero, mm: command the drives with this"
    )
    correction_mm: Links | None = absent(
        "what was added to each link's uncompensated command, within its limits, mm; `scale_setpoint_mm - "
        "correction_mm` is that command"
    )
    sources_mm: dict[str, Links] | None = absent(
        "how much each cause asks for, for each link, mm: `joints`, `frame`, then by its id what each effect adds to "
        "those before it; their sum is the correction before its limits. Machines without scales, and `machine: "
        "external`: how much of `tip_correction_mm`, along each axis, before limits"
    )
    u_tip_um: float | None = absent(
        "how far the tip may be from `tip_M_mm`, with the tool on the plate `tip_P_mm`, um: 95 % bound of the "
        "distance, in every valid setpoint for which it is known. It has the gauges' noise and the errors of the "
        "fitted parameters, how far each length may have gone since it was read, and what is not corrected. "
        "`limits.tip_error_um` limits it"
    )
    shadow: ShadowKeys | None = absent("what the shadow model asks for in this cycle; absent without a shadow")
