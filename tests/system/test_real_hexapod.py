"""A real hand-built hexapod, measured by motion capture: what its drawing lacks is named, and poses of another session
are predicted better. Its data are in ../shared; nothing of them is kept here.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import compd
from compd.arrays import rms
from compd.comparison.recording_comparison import compare
from compd.diagnosis import Diagnosis
from docs.gallery.real_hexapod import PLAIN_BLOCKS, SESSIONS, machine, recording

# What least squares on the leg lengths, written for this machine alone, leaves at the position is 424 um.
MAX_SEALED_UM = 420.0
MAX_SEALED_WITH_GAIN_OF_EXTENSION_UM = 370.0
# Legs, after registration: zeros, gains and base joints by least squares, written for this machine alone, leave 0.35 mm
# on this session, and 0.32 with a gain that changes with extension.
MAX_SEALED_LEGS_MM = 0.34
MAX_SEALED_LEGS_WITH_GAIN_OF_EXTENSION_MM = 0.33
NAMED = set(PLAIN_BLOCKS)
# An effect of its owner's, as docs/how-to/add-an-effect.md says.
GAIN_OF_EXTENSION = """
id: gain_of_extension
port: scale
physics: "the line winds in layers, and a turn of the spool winds more where it is full"
formula: "k * reading_mm ** 2"
parameters:
  k: {unit: um/mm^2, plausible: [-1, 1], source: "a line of 1 mm on a spool of 11 mm", per: link}
"""


def diagnosed(directory: Path, effects: str = "") -> tuple[Diagnosis, float, float]:
    """The diagnosis of 108 poses, and what is left of 60 others before and with it, um per coordinate."""
    configuration = machine(directory)
    own = directory / "own.yaml"
    own.write_text(effects, encoding="utf-8")
    learned = compd.open_recording(recording(directory, "poses-108"), configuration)
    diagnosis = compd.diagnose(learned, effects=own if effects else ())
    sealed = compd.open_recording(recording(directory, "poses-60"), configuration)
    return diagnosis, compare(sealed).rms_um, compare(sealed, diagnosis.after.fitted).rms_um


@pytest.mark.long
@pytest.mark.skipif(not SESSIONS.is_dir(), reason="the sessions of a real hexapod are beside the project, in ../shared")
def test_zeros_gains_and_joints_of_a_hand_built_hexapod_are_named(tmp_path: Path) -> None:
    diagnosis, before_um, after_um = diagnosed(tmp_path)
    assert {step.effect.id for step in diagnosis.steps} == NAMED
    assert not [finding for finding in diagnosis.depends_on if finding.is_change]
    assert after_um <= MAX_SEALED_UM < before_um / 3


@pytest.mark.long
@pytest.mark.skipif(not SESSIONS.is_dir(), reason="the sessions of a real hexapod are beside the project, in ../shared")
def test_a_gain_that_changes_with_extension_is_named_where_its_owner_suspects_it(tmp_path: Path) -> None:
    diagnosis, _, after_um = diagnosed(tmp_path, GAIN_OF_EXTENSION)
    assert {step.effect.id for step in diagnosis.steps} == NAMED | {"gain_of_extension"}
    assert not [finding for finding in diagnosis.depends_on if finding.is_change]
    assert after_um <= MAX_SEALED_WITH_GAIN_OF_EXTENSION_UM


@pytest.mark.skipif(not SESSIONS.is_dir(), reason="the sessions of a real hexapod are beside the project, in ../shared")
def test_the_calibrated_hexapod_has_legs_as_long_as_measured_on_another_session(tmp_path: Path) -> None:
    configuration = machine(tmp_path)
    learned, sealed = (
        compd.open_recording(recording(tmp_path, name), configuration) for name in ("poses-108", "poses-60")
    )
    result = compd.calibrate(learned, sealed)
    assert {block.name for block in result.blocks if block.needed} >= NAMED | {"scale_gain_change"}
    assert rms(result.sealed[0].after_links_mm) <= MAX_SEALED_LEGS_WITH_GAIN_OF_EXTENSION_MM
    assert result.sealed[0].after_rms_um < result.sealed[0].before_rms_um / 4
    assert not result.gross


@pytest.mark.skipif(not SESSIONS.is_dir(), reason="the sessions of a real hexapod are beside the project, in ../shared")
def test_zeros_gains_and_base_joints_alone_are_told_as_well(tmp_path: Path) -> None:
    configuration = machine(tmp_path)
    learned, sealed = (
        compd.open_recording(recording(tmp_path, name), configuration) for name in ("poses-108", "poses-60")
    )
    result = compd.calibrate(learned, sealed, blocks=sorted(NAMED))
    assert rms(result.sealed[0].after_links_mm) <= MAX_SEALED_LEGS_MM
