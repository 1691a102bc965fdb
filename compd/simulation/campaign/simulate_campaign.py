"""A simulated measuring campaign as files: recording, sidecar, and the sealed answer of the hidden causes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from compd.configuration import Machine, load_machine
from compd.errors import CompdError
from compd.recording import write_plate, write_recording
from compd.simulation.campaign.plan_reader import read_plan
from compd.simulation.campaign.simulated_recording import FIXED, simulate_recording
from compd.simulation.causes.hidden_cause import draw_hidden, parse_hidden, write_answer
from compd.simulation.truth.instruments import Kind
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero
from compd.table_file import written_path


@dataclass(frozen=True)
class CampaignFiles:
    """Files and figures of a simulated campaign.

    Attributes
    ----------
    recording : Path
        NAME.csv or NAME.parquet, with its sidecar NAME.yaml beside it.
    answer : Path
        NAME.answer.json: what was hidden, and how strong. Leave it shut if you want to find out by a diagnosis.
    rows : int
        Rows of the recording.
    columns : int
        Columns of the recording.
    measured : int
        Rows in which the reference measured; in the others only the gauges were read.
    planned : int
        Rows of the plan that was measured; 0 without a plan.
    """

    recording: Path
    answer: Path
    rows: int
    columns: int
    measured: int
    planned: int


def simulate_campaign(
    machine: Machine,
    out: str | Path,
    *,
    seed: int = 1,
    effects: Sequence[str] = (),
    hidden: int | None = None,
    reference: Kind = "tracker",
    other_days: int = 0,
    plan: str | Path | None = None,
    zero_degC: float = STANDARD_AIR.temperature_degC,
    overwrite: bool = False,
) -> CampaignFiles:
    """Simulate a measuring campaign on a machine that does not exist, and write it as a recording.

    About 600 rows in four sessions on four days: points in the workspace, each approached from several sides, loads,
    repeats, passes without a stop, weather and warm-up, 1 % outliers. Two disturbances of a fifth of the noise are
    always in it. The simulated machine shares no code with the model.

    Parameters
    ----------
    machine : str, Path or Configuration
        As `load_machine` takes it.
    out : str or Path
        The recording to write, NAME.csv or NAME.parquet; NAME.yaml is written beside it, and NAME.answer.json.
    seed : int
        Machine, weather, points and noise follow from it.
    effects : sequence of str
        Causes that the gauges do not see: ``"id=strength"`` in the unit of the effect's parameter, or ``"id"`` alone
        for an error of three times the noise.
    hidden : int, optional
        Hide a cause, chosen with its size by this number.
    reference : str
        The instrument beside the machine: ``"tracker"`` (0.15 um per axis), ``"interferometer"`` (0.05 um, along the
        links), ``"ball_plate"``, ``"ballbar"`` (0.2 um, of 100 mm from three balls), ``"pin"`` (three fixed pins; a
        hexapod comes with twelve attitudes), ``"ball"`` (a calibrated ball of 25 mm at three places, touched) or
        ``"pose"`` (the tip and the attitude, 2 urad).
    other_days : int
        Number of another campaign on the same machine, with other points, weather and loads; 0 is the first one.
    plan : str or Path, optional
        Measure these rows, as `MeasurementPlan.write` writes them, and nothing else.
    zero_degC : float
        Temperature of machine and room when machine zero is taken.
    overwrite : bool
        Whether existing files are replaced.

    Returns
    -------
    CampaignFiles

    Raises
    ------
    CompdError
        Where there is no such cause, a strength is no number, the plan cannot be measured on this machine, or the
        files are there already or cannot be written.

    Examples
    --------
    >>> import compd
    >>> where = "monday.csv"
    >>> files = compd.simulate_campaign("tripod-cmm", where, seed=5, hidden=125)
    >>> files.rows, files.measured
    (608, 608)
    """
    path = written_path(Path(out))
    _check_apart(path, machine)
    configuration = load_machine(machine)
    mechanism = Mechanism(configuration.geometry)
    if plan is not None and reference in ("ball_plate", *FIXED):
        raise CompdError.of(
            "reference",
            "a ball plate's balls are not where the plan goes"
            if reference == "ball_plate"
            else "fixed balls and pins are not where the plan goes",
            value=reference,
            allowed="tracker, interferometer, pose",
            next_step="leave the plan or the reference out",
        )
    planned = () if plan is None else read_plan(Path(plan), mechanism)
    causes = parse_hidden(effects)
    if hidden is not None:
        causes.append(draw_hidden(hidden, mechanism, configuration.wiring))
    plate = path.with_name(f"{path.stem}.plate.csv")
    recorded = simulate_recording(
        configuration, seed, causes, reference, plate.name, other_days, planned, AirAtZero(zero_degC)
    )
    write_recording(path, recorded.columns, recorded.sidecar, overwrite)
    if recorded.balls_M is not None:
        write_plate(plate, recorded.balls_M)
    answer = path.with_name(f"{path.stem}.answer.json")
    write_answer(answer, recorded.hidden, recorded.weak, seed)
    rows = len(recorded.columns["time_s"])
    unmeasured = sum(map(math.isnan, recorded.columns[min(recorded.reference_columns)])) if planned else 0
    return CampaignFiles(path, answer, rows, len(recorded.columns), rows - unmeasured, len(planned))


def _check_apart(path: Path, machine: Machine) -> None:
    """Raise CompdError if the recording's sidecar would replace the machine's own configuration."""
    sidecar = path.with_suffix(".yaml")
    if isinstance(machine, str | Path) and sidecar.resolve() == Path(machine).resolve():
        raise CompdError.of(
            str(path),
            "its sidecar would replace the machine's configuration",
            value=str(sidecar),
            next_step="give the recording another name or place",
        )
