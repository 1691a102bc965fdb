"""Recordings of every kind as directories of cases: of the scoreboard's families, the examples, the gallery, real ones.

A directory has train.csv with its sidecar and, where it takes them, machine.yaml, effects.yaml and known.json: what
`tests.scoreboard.trial.diagnose_case` reads.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import yaml

import compd
from docs.gallery.cases import CASES as GALLERY
from docs.gallery.cases import Case as GalleryCase
from tests.scoreboard.cases import FAMILIES, cases
from tests.scoreboard.prepare import prepare
from tests.scoreboard.real import PLACE, prepare_real
from tests.support.changed_recordings import RecordingFile, read_file
from tests.support.paths import RECORDINGS, ROOT

Make = Callable[[Path], Path]
# Recording and effects that each example leaves behind.
EXAMPLES = {
    "first_recording.py": ("first.csv", None),
    "find_missing_effect.py": ("first-days.csv", None),
    "external_machine.py": ("monday.csv", None),
    "arm_parameters.py": ("monday.csv", "arm-effects.yaml"),
}
SHARED_EXAMPLES = tuple(
    f"example-{name}"
    for name in ("elastic-and-backlash", "link-expansion", "not-in-the-library", "nothing-missing", "plate-bending")
)
REAL = (
    "voron-frame-expansion",
    "voron-run-3",
    "telescope-pointing-2022",
    "plug-plate-1597A-2011",
    "slit-stage-11358-1",
    "probe_GX_H8A",
    "irb_base2",
    "iso_resolver",
    "slit11358_1_place_B",
)
# What belongs to a case beside its recording.
BESIDE = ("machine.yaml", "effects.yaml", "known.json")


def sources() -> Mapping[str, Make]:
    """How to make each recording, by name; a case of every family of the scoreboard comes first."""
    return {
        **{f"family {name}": _of_family(name) for name in FAMILIES},
        **{f"example {name}": _of_example(name) for name in EXAMPLES},
        **{f"gallery {case.name}": _of_gallery(case) for case in GALLERY},
        **{f"shared {name}": _of_shared(name) for name in SHARED_EXAMPLES},
        **{f"real {name}": _of_real(name) for name in REAL},
    }


def read_case(directory: Path) -> RecordingFile:
    """The recording of a case, with its formulas."""
    effects = directory / "effects.yaml"
    formulas = yaml.safe_load(effects.read_text(encoding="utf-8")) if effects.exists() else ()
    return read_file(directory / "train.csv", tuple(formulas))


def write_case(file: RecordingFile, like: Path, directory: Path) -> Path:
    """Write a changed recording into a directory, with what belongs to the case `like` beside it."""
    for name in BESIDE:
        if (like / name).exists():
            shutil.copyfile(like / name, directory / name)
    if file.formulas:
        (directory / "effects.yaml").write_text(yaml.safe_dump(list(file.formulas)), encoding="utf-8")
    file.write(directory / "train.csv")
    return directory


def _of_family(name: str) -> Make:
    return lambda directory: prepare(cases([name], "test")[0], directory)


def _of_example(name: str) -> Make:
    recording, effects = EXAMPLES[name]

    def make(directory: Path) -> Path:
        subprocess.run([sys.executable, ROOT / "examples" / name, directory], cwd=ROOT, check=True, capture_output=True)
        return _as_case(directory / recording, None if effects is None else directory / effects)

    return make


def _of_gallery(case: GalleryCase) -> Make:
    def make(directory: Path) -> Path:
        recording = directory / "learn.csv"
        compd.simulate_campaign(case.machine, recording, seed=case.seed, effects=case.effects)
        return _as_case(recording)

    return make


def _of_shared(name: str) -> Make:
    def make(directory: Path) -> Path:
        recording = RECORDINGS / name / "train.csv"
        if not recording.exists():
            pytest.skip(f"{recording} is absent")
        return _as_case(recording, copy_to=directory)

    return make


def _of_real(name: str) -> Make:
    def make(directory: Path) -> Path:
        found = {path.name: path for path in prepare_real(directory, PLACE)}
        if f"real_{name}" not in found:
            pytest.skip(f"{PLACE / name}.csv is absent")
        return found[f"real_{name}"]

    return make


def _as_case(recording: Path, effects: Path | None = None, copy_to: Path | None = None) -> Path:
    """The directory of the recording, in which it is train.csv."""
    directory = copy_to or recording.parent
    for suffix in (".csv", ".yaml"):
        if recording.with_suffix(suffix) != directory / f"train{suffix}":
            shutil.copyfile(recording.with_suffix(suffix), directory / f"train{suffix}")
    if effects is not None:
        shutil.copyfile(effects, directory / "effects.yaml")
    return directory
