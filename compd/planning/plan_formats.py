"""A plan's rows in what the instrument and the controller take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from compd.errors import CompdError
from compd.instruments import (
    CSV_MARK,
    MARK,
    SA_MARK,
    FeedAndDwell,
    TargetPoint,
    Way,
    write_csv_targets,
    write_gcode,
    write_sa_targets,
)
from compd.plan_file import NOT_SET, PURPOSE_COLUMN, SPEED_COLUMN, TIP_COLUMNS, TURN_COLUMNS, plan_text

PlanFormat = Literal["plan", "sa", "csv", "gcode"]
# Dwell (s) in which an instrument averages its readings, and every gauge is read again.
DWELL_S = 3.0
# What the first bytes of such a file contain.
MARKS: Mapping[str, bytes] = {"sa": SA_MARK.encode(), "csv": CSV_MARK.encode(), "gcode": MARK.encode()}
_NAME_DIGITS = 3


def target_name(row: int) -> str:
    """Name of the row's target, by which `compd recording join --by name` finds it again: "P007"."""
    return f"P{row:0{_NAME_DIGITS}d}"


def plan_targets(rows: Sequence[Mapping[str, Any]], ways: Sequence[Way | None] = ()) -> list[TargetPoint]:
    """The rows as targets. ways : of each row; () where they are not known."""
    targets = []
    last_s = np.inf
    for k, row in enumerate(rows):
        # of a machine whose kinematics is not known, a column of the same name is one setting among others
        with_place = all(name in row for name in (*TIP_COLUMNS, SPEED_COLUMN))
        tip = np.array([row[name] for name in TIP_COLUMNS]) if with_place else None
        motion = [name for name in row if with_place and (name.startswith("approach_") or name == SPEED_COLUMN)]
        place = TIP_COLUMNS if with_place else ()
        turn = np.array([row[name] for name in TURN_COLUMNS]) if with_place and TURN_COLUMNS[0] in row else None
        turned = TURN_COLUMNS if turn is not None else ()
        settings = {name: row[name] for name in row if name not in (*NOT_SET, *place, *turned, *motion)}
        way = ways[k] if ways else None
        wanted = any(row[name] for name in motion)
        targets.append(
            TargetPoint(
                name=target_name(row.get("row", k + 1)),
                purpose=row[PURPOSE_COLUMN],
                tip_M_mm=tip,
                turn_rad=turn,
                settings=settings,
                begins=not row["time_s"] > last_s,
                time_s=row["time_s"],
                way=way,
                no_way=_no_way(row, motion) if tip is not None and wanted and way is None else "",
            )
        )
        last_s = row["time_s"]
    return targets


def rows_text(
    rows: Sequence[Mapping[str, Any]],
    shape: PlanFormat,
    title: str,
    ways: Sequence[Way | None] = (),
    feed_mm_per_min: float | None = None,
    dwell_s: float = DWELL_S,
) -> str:
    """The text of a file of a plan's rows. title : of a programme. Raises CompdError as `target_bytes` does."""
    if shape == "plan":
        return plan_text(rows)
    motion = None if feed_mm_per_min is None else FeedAndDwell(feed_mm_per_min, dwell_s)
    return target_bytes(rows, shape, ways, motion, title).decode()


def target_bytes(
    rows: Sequence[Mapping[str, Any]],
    shape: PlanFormat,
    ways: Sequence[Way | None] = (),
    motion: FeedAndDwell | None = None,
    title: str = "",
) -> bytes:
    """The bytes of a list of targets, or of a programme. ways, motion, title : for G-code.

    Raises CompdError for rows without a place of the tip, but as a list with commas; for G-code without a feed.
    """
    targets = plan_targets(rows, ways)
    if shape == "csv":
        return write_csv_targets(targets)
    if any(target.tip_M_mm is None for target in targets):
        raise CompdError.of(
            f"--as {shape}",
            "needs places of the tip, and this plan sets columns of a machine whose kinematics is not known",
            value=", ".join(name for name in rows[0] if name not in NOT_SET),
            allowed="--as csv",
            next_step="leave --as out, or take --as csv",
        )
    if shape == "sa":
        return write_sa_targets(targets)
    if motion is None:
        raise CompdError.of(
            "--as gcode",
            "needs a feed between the places, which no plan knows",
            allowed="more than 0 mm/min",
            next_step="give --feed, in mm/min",
        )
    return write_gcode(targets, motion, title)


def _no_way(row: Mapping[str, Any], motion: Sequence[str]) -> str:
    """What the person at the controller has to do where no straight way of the tip is as wanted."""
    wanted = ", ".join(f"{name} {row[name]:+g}" for name in motion if row[name])
    return f"by hand: no straight way of the tip moves the links as wanted: {wanted}"
