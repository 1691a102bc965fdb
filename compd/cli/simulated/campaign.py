"""`compd campaign`: a recording from a machine that does not exist, as a measuring campaign would bring home."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class ReferenceKind(StrEnum):
    """What measures beside the gauges."""

    tracker = "tracker"
    interferometer = "interferometer"
    ball_plate = "ball_plate"


def campaign(
    config: Annotated[Path, typer.Argument(help="The machine's configuration; it is read, never written.")],
    out: Annotated[Path, typer.Option(help="The recording to write: NAME.csv, and NAME.yaml beside it.")],
    seed: Annotated[int, typer.Option(min=0, help="Machine, weather, points and noise follow from it.")] = 1,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="A cause that the gauges do not see: id=strength, or id alone for three times the noise."),
    ] = None,
    hidden: Annotated[
        int | None, typer.Option(min=0, help="Hide a cause that follows from this number, under seal.")
    ] = None,
    reference: Annotated[ReferenceKind, typer.Option(help="The instrument beside it.")] = ReferenceKind.tracker,
    other_days: Annotated[
        int, typer.Option(min=0, help="Another campaign on the same machine: other points, weather and loads.")
    ] = 0,
    plan: Annotated[
        Path | None, typer.Option(help="Measure these rows, as `compd plan --out` has written them, and nothing else.")
    ] = None,
    overwrite: Annotated[bool, typer.Option(help="Write over files that are there.")] = False,
) -> None:
    """Simulate a measuring campaign: about 600 rows in four sessions, repeats, loads, passes, 1 % outliers.

    Two disturbances of a fifth of the noise are always in it. What was hidden, and how strong, is written to
    NAME.answer.json; who wants to diagnose leaves that file shut.
    """
    import math

    from rich.console import Console

    from compd.configuration import load
    from compd.errors import CompdError, Problem
    from compd.recording.ball_plate import write_plate
    from compd.recording.writer import write_recording
    from compd.simulation.campaign.plan_reader import read_plan
    from compd.simulation.campaign.simulated_recording import simulate_recording
    from compd.simulation.causes.hidden_cause import draw_hidden, parse_hidden, write_answer
    from compd.simulation.truth.mechanism import Mechanism

    configuration = load(config)
    path = out if out.suffix == ".csv" else out.with_name(f"{out.name}.csv")
    mechanism = Mechanism(configuration.geometry)
    if plan is not None and reference is ReferenceKind.ball_plate:
        raise CompdError(
            Problem(
                where="--reference",
                what="a ball plate's balls are not where the plan goes",
                value=reference.value,
                allowed="tracker, interferometer",
                next_step="leave --plan or --reference out",
            )
        )
    planned = () if plan is None else read_plan(plan, mechanism)
    hidden_causes = parse_hidden(effect or [])
    if hidden is not None:
        hidden_causes.append(draw_hidden(hidden, mechanism))
    plate = path.with_name(f"{path.stem}.plate.csv")
    recorded = simulate_recording(configuration, seed, hidden_causes, reference.value, plate.name, other_days, planned)
    write_recording(path, recorded.columns, recorded.sidecar, overwrite)
    if recorded.balls_M is not None:
        write_plate(plate, recorded.balls_M)
    answer = path.with_name(f"{path.stem}.answer.json")
    write_answer(answer, recorded.hidden, recorded.weak, seed)
    rows = len(recorded.columns["time_s"])
    summary = f"{rows} rows, {len(recorded.columns)} columns"
    if planned:
        measured = rows - sum(map(math.isnan, recorded.columns[min(recorded.reference_columns)]))
        summary = (
            f"the plan's {len(planned)} rows, {measured} with repeats, and {rows - measured} between them that only "
            "the gauges saw"
        )
    Console().print(f"{path}: {summary}; under seal: {answer}", soft_wrap=True)
