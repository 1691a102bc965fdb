"""A demo session on a terminal: the live table, the tables at its end and the result in one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table as TerminalTable

from compd.demo.session import ATTEMPTS, KINDS, DemoSession
from compd.units import UM_PER_MM

LABELS = {"none": "no compensation", "joints": "joints only", "full": "joints and frame"}


def error_rows(session: DemoSession) -> list[list[str]]:
    """Tip error against the truth: rms, 95 % and largest distance, by kind of compensation."""
    rows = []
    for kind in KINDS:
        errors = [visit.error_um[kind] for visit in session.visits]
        p95, largest = (float(np.percentile(errors, 95)), max(errors)) if errors else (float("nan"),) * 2
        rows.append([LABELS[kind], f"{session.rms_um(kind):.2f} um", f"{p95:.2f} um", f"{largest:.2f} um"])
    return rows


LOOP_ROWS = {
    "rate_hz": "loop rate, Hz",
    "cycles": "cycles",
    "missed_cycles": "missed cycles",
    "period_mean_ms": "period, mean, ms",
    "period_deviation_ms": "period, standard deviation, ms",
    "lateness_median_us": "wake-up lateness, median, us",
    "lateness_p99_us": "wake-up lateness, 99 %, us",
    "cycle_median_us": "time per cycle, median, us",
}


def timing_rows(session: DemoSession) -> list[list[str]]:
    """The loop's period and the gauges' ages, from the daemon's STATUS and its setpoints."""
    loop = session.status.get("loop", {})
    rows = [[label, f"{loop[key]:.4g}"] for key, label in LOOP_ROWS.items() if key in loop]
    ages = [message["age_s"] * 1e3 for message in session.setpoints if "age_s" in message]
    if ages:
        rows.append(["age of the oldest gauge, median, ms", f"{np.median(ages):.1f}"])
        rows.append(["age of the oldest gauge, largest, ms", f"{max(ages):.1f}"])
    return rows


def progress(session: DemoSession, elapsed_s: float, seconds: float, setpoint: dict[str, Any]) -> RenderableType:
    """The live table: the newest points, and the setpoint in force."""
    title = f"distance of the true tip from its target, um; {len(session.visits)} points"
    table = TerminalTable(title=title)
    for head in ("s", "target, mm", "without", "joints", "joints, frame"):
        table.add_column(head, justify="right", no_wrap=True)
    for visit in session.visits[-10:]:
        table.add_row(
            f"{visit.time_s:.1f}",
            " ".join(f"{x:6.1f}" for x in visit.target_mm),
            *(f"{visit.error_um[kind]:.2f}" for kind in KINDS),
        )
    correction = " ".join(f"{value * UM_PER_MM:+.2f}" for value in setpoint.get("correction_mm", []))
    line = f"setpoint {setpoint['seq']}: {setpoint['state']} {setpoint['reason']}  correction {correction} um"
    return Group(table, line, ProgressBar(total=seconds, completed=min(elapsed_s, seconds), width=60))


def summarise(session: DemoSession) -> RenderableType:
    """The tables at the end of the demo."""
    errors = TerminalTable(
        "tip error against the truth",
        "rms",
        "95 %",
        "largest",
        title=f"{session.machine}: {len(session.visits)} points measured at rest",
    )
    for row in error_rows(session):
        errors.add_row(*row)
    timing = TerminalTable("loop and gauges", "")
    for row in timing_rows(session):
        timing.add_row(*row)
    return Group(errors, timing)


def verdict(session: DemoSession) -> str:
    """The result in one sentence."""
    if session.shortcoming:
        return f"The demo gave no result on this computer in {ATTEMPTS} attempts: {session.shortcoming}."
    rms_um = {kind: session.rms_um(kind) for kind in KINDS}
    return (
        f"At {len(session.visits)} points the tip missed its target by {rms_um['none']:.1f} um (rms) without "
        f"compensation, by {rms_um['joints']:.1f} um with the joints compensated, and by {rms_um['full']:.2f} um "
        "with joints and frame compensated."
    )
