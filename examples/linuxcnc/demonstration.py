"""The whole demand through a controller: a program's error, corrected, its rest diagnosed by probing, and adopted."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from artefact import (
    CORNERS_mm,
    probing_program,
    write_artefact,
    write_probed_recording,
)
from compd.client import connect
from compd.configuration import Configuration
from compd.demo import Command, run_commands, simulated_daemon, take_zero
from compd.errors import CompdError, DaemonError
from compd.gauge import Quality
from compd.simulation import ControlClient, Mechanism
from controller import LinuxCnc, ProgramStopped
from motion_log import MotionSample, TipErrors, read_motion_log, tip_errors

# Speed-up of weather and warm-up: a minute of demonstration is half an hour.
SPEEDUP = 30.0
# Time (s) at machine zero, until the controller commands the machine.
ZERO_HOLD_S = 600.0
SHIPPED_PROGRAM = Path(__file__).parent / "program.ngc"
# Heat (W) of each drive during each round of probing. The drives work hard, idle, and work hard again, which separates
# growth by the links' temperature from growth with time.
ROUNDS_W = (3.0, 3.0, 0.3, 3.0)
# The rest of the machine's heat, as after switch-on: base ring, cabinet by column, platform, tool, lamps.
_OTHER_HEAT = {"ring_W": 12.0, "cabinet_W": [8.0, 3.0, 4.0], "platform_W": 0.4, "tool_W": 0.0, "lamps_W": 3.0}
MAX_PROGRAM_S = 1200.0
# Attempts to switch corrections on before it is an error; a busy computer disarms the bridge.
ARMINGS = 20
# Attempts to run a program.
RUNS = 5
# Ratio of error and noise below which the model needs no further effect.
NOISE_RATIO = 2.0
# Time (s) to reach the correction of another model at `limits.slew_mm_per_s`: 0.2 mm take 0.4 s.
ADOPTED_S = 10.0

OFF, ON, ADOPTED = "corrections off", "corrections on", "the effect adopted"


@dataclass
class LinuxCncDemo:
    """Result of the demonstration.

    errors : of the program, by how it was run. rows : that were probed. diagnosis : of these, in a sentence.
    adopted : the effects of it that are worth their place in the model, in order.
    """

    errors: dict[str, TipErrors] = field(default_factory=dict)
    rows: int = 0
    diagnosis: str = ""
    adopted: list[str] = field(default_factory=list)


def run_demonstration(
    configuration: Configuration,
    out: Path,
    seed: int,
    effects: Sequence[str],
    tell: Callable[[str], None],
    program: Path = SHIPPED_PROGRAM,
    speedup: float = SPEEDUP,
) -> LinuxCncDemo:
    """Probe during the warm-up; run the program without and with corrections; adopt the diagnosis; run it again.

    Parameters
    ----------
    configuration : of the shipped hexapod.
    out : existing directory for recording and model file.
    seed : of weather and joints.
    effects : hidden in the machine, as for `compd sim run --effect`.
    tell : called with what happens.
    program : G-code, to be run at the machine's zero, which it comes back to.
    speedup : factor by which weather and warm-up run faster than the machine moves.

    Raises CompdError if LinuxCNC is not installed, something does not start, or the program stops.
    """
    demo = LinuxCncDemo()
    with simulated_daemon(configuration, seed, speedup, ZERO_HOLD_S, effects) as directory:
        write_artefact(directory / "artefact.json")
        take_zero(directory / "compd.sock")
        with LinuxCnc(directory / "controller", directory) as controller:
            session = _Session(configuration, directory, controller, program, tell)
            controller.switch_on()
            session.correct()
            tell(f"LinuxCNC is homed. Probing {len(CORNERS_mm)} calibrated corners while the machine warms up ...")
            recording = out / "probed.csv"
            demo.rows = session.probe(recording)
            controller.without_corrections()
            tell("The program, without corrections ...")
            demo.errors[OFF] = session.run_program()
            session.correct()
            tell("The program, with corrections ...")
            demo.errors[ON] = session.run_program()
            tell(f"compd diagnose {recording}")
            demo.diagnosis, demo.adopted = diagnose(recording, configuration.path)
            tell(demo.diagnosis)
            if demo.adopted:
                model = out / "probed.model.yaml"
                add_effects(demo.adopted, recording, configuration.path, model)
                session.adopt(model)
                tell(f"{', '.join(demo.adopted)} adopted. The program again ...")
                demo.errors[ADOPTED] = session.run_program()
    return demo


class _Session:
    """A controller on a simulated machine with its daemon, and repeated actions on them."""

    def __init__(
        self,
        configuration: Configuration,
        directory: Path,
        controller: LinuxCnc,
        program: Path,
        tell: Callable[[str], None],
    ) -> None:
        self._directory, self._controller, self._tell = directory, controller, tell
        self._told = ""  # last
        self._mechanism = Mechanism(configuration.geometry)
        self._links = configuration.geometry.links
        self._program = self._copied("program.ngc", program.read_text())
        self._probing = self._copied("probing.ngc", probing_program())

    def run_program(self) -> TipErrors:
        return tip_errors(self._mechanism, self._run(self._program))

    def correct(self) -> None:
        """Switch the corrections on. Raises DaemonError if they fail to stay on ARMINGS times."""
        for tries_left in reversed(range(ARMINGS)):
            try:
                self._controller.with_corrections()
                return
            except DaemonError:
                if not tries_left:
                    raise
                self._acknowledge()

    def probe(self, recording: Path) -> int:
        """Probe every corner some times beside a recorder; write the recording, and return its rows."""
        stem = self._directory / "gauges"
        rounds = []
        record = Command(
            ["recording", "start", str(stem), "--daemon", str(self._directory / "compd.sock")],
            ready=self._directory / "gauges-0001.csv",
        )
        with run_commands([record], log=self._directory / "record.log"):
            for number, drive_W in enumerate(ROUNDS_W, 1):
                self._tell(f"  round {number} of {len(ROUNDS_W)}, {drive_W:g} W in each drive")
                self.heat(drive_W)
                rounds.append(self._run(self._probing))
        return write_probed_recording(recording, sorted(self._directory.glob("gauges-*.csv")), rounds)

    def heat(self, drive_W: float) -> None:
        """Set the heat of each drive from now on."""
        with ControlClient(self._directory / "control.sock") as machine:
            machine.ask("HEAT", drives_W=[drive_W] * self._links, **_OTHER_HEAT)

    def adopt(self, model: Path) -> None:
        """Give the daemon the model; returns when the correction has slewed to it."""
        with connect(self._directory / "compd.sock", ADOPTED_S) as daemon:
            adopted = daemon.model(str(model.absolute()))["applied"]["model"]
            while (setpoint := daemon.latest(ADOPTED_S)).get("model") != adopted or setpoint["state"] != "ok":
                pass

    def _run(self, program: Path) -> list[MotionSample]:
        """Run a program; repeat it if LinuxCNC stops it, as for a late probe. Raises DaemonError after RUNS."""
        for runs_left in reversed(range(RUNS)):
            try:
                start_s, end_s = self._controller.run(program, MAX_PROGRAM_S, self._go_on)
                break
            except ProgramStopped as stopped:
                if not runs_left:
                    raise
                self._tell(f"  LinuxCNC {stopped.problems[0].what}. Once more.")
        return read_motion_log(self._controller.motion_log, start_s, end_s)

    def _go_on(self, held_by: str) -> None:
        """The operator's action for a stopped machine: acknowledge, and arm."""
        acknowledged = self._acknowledge()
        outcome = "armed again" if self._controller.arms() else "not armed yet"
        told = f"  The feed was held: {held_by}. {', '.join([*acknowledged, outcome])}."
        if told != self._told:
            self._tell(told)
        self._told = told

    def _acknowledge(self) -> list[str]:
        """Accept every distrusted gauge; return a description. In this machine none is wrong."""
        with connect(self._directory / "compd.sock", ADOPTED_S) as daemon:
            gauges = [gauge["channel"] for gauge in daemon.status()["gauges"] if gauge["quality"] == Quality.DISTRUSTED]
            for gauge in gauges:
                daemon.accept(gauge)
        return [f"{gauge} accepted" for gauge in gauges]

    def _copied(self, name: str, text: str) -> Path:
        path = self._controller.directory / name
        path.write_text(text)
        self._controller.give(path)
        return path


def diagnose(recording: Path, machine: Path) -> tuple[str, list[str]]:
    """`compd diagnose` on a recording: its text, and the named effects that are worth adding."""
    result = json.loads(_compd("diagnose", str(recording), "--machine", str(machine), "--json"))
    effects = []
    for step in result["steps"]:
        effects.append(step["effect"])
        if step["heldout_rms_um"] <= NOISE_RATIO * result["noise_floor_um"]:
            break
    return result["said"], effects


def add_effects(effects: Sequence[str], recording: Path, machine: Path, model: Path) -> None:
    """`compd model add`, for one effect after the other, into a new model file."""
    model.unlink(missing_ok=True)
    for effect in effects:
        _compd("model", "add", effect, "--recording", str(recording), "--machine", str(machine), "--model", str(model))


def _compd(*arguments: str) -> str:
    """Run a command of compd; return its output. Raises CompdError with its message."""
    result = subprocess.run(
        [sys.executable, "-P", "-m", "compd", *arguments], capture_output=True, text=True, check=False
    )
    if result.returncode:
        raise CompdError.of(f"compd {' '.join(arguments)}", "failed", next_step=f"read what it says:\n{result.stderr}")
    return result.stdout
