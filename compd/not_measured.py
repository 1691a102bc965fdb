"""What no gauge of a machine measures, and what follows: the same words in `check`, `status` and VERSION."""

from __future__ import annotations

from compd.configuration import Configuration
from compd.operation_settings import FRAME_DISTANCES


def not_measured(configuration: Configuration) -> list[str]:
    """One clause for each kind of gauge that is not wired: what it would measure, and what is taken in its place.

    Empty where scales, joints, frame and temperatures are measured, and for `machine: external` of what compd does not
    know of it.
    """
    wiring, known = configuration.wiring, configuration.external is None
    clauses = []
    if not wiring.scale:
        clauses.append("the scales: the pose that a controller commands is corrected")
    if known and not wiring.joint:
        clauses.append("the joints, which are taken not to move along their links")
    if known and len(wiring.frame) < len(FRAME_DISTANCES):
        what = (
            "the frame's t1 to t3, which are taken to stay as at machine zero"
            if wiring.frame
            else "the frame, which is taken to stand still"
        )
        clauses.append(f"{what}; {_frame_drift(wiring.frame_drift_um)}")
    if not any(quantity.name.startswith("temperature_") for quantity in wiring.quantities):
        clauses.append("temperatures: what heat does is not corrected")
    return clauses


def _frame_drift(drift_um: float | None) -> str:
    """What a frame that is not measured does to the tip's uncertainty."""
    if drift_um is None:
        return "the tip's uncertainty is unknown until `wiring: frame_drift_um` states how far that moves the tip"
    return f"by that the tip is uncertain by {drift_um:g} um along each axis"
