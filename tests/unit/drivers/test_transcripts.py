"""Every transcript is replayed: what the driver sends, what it reads and what it makes of it, byte for byte."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.gauge import LineFault
from compd.plugins import GAUGES, names
from compd_drivers.presets import directory
from tests.support.paths import TESTS
from tests.support.transcripts import check_simulated_device, gauge_of, parse, replay_transcript

FILES = sorted((TESTS / "transcripts").glob("*.txt"))
# Their maps are tried in tests of their own; the presets on modbus have transcripts, mqtt and opc_ua real other ends.
GENERIC = {"modbus", "mqtt", "opc_ua"}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_replay(path: Path) -> None:
    replay_transcript(path)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_simulated_device_says_the_same(path: Path) -> None:
    check_simulated_device(path)


def test_every_driver_has_a_transcript() -> None:
    assert {parse(path).driver for path in FILES} | GENERIC == set(names(GAUGES))


@pytest.mark.parametrize("name", directory.names())
def test_every_variant_of_a_preset_has_a_transcript(name: str) -> None:
    preset, _ = directory.read(name)
    transcripts = [parse(path) for path in FILES if parse(path).driver == name]
    chosen = [gauge_of(transcript)[1].model_dump() for transcript in transcripts]
    for variant in preset.variants:
        assert any(variant.applies(options) for options in chosen), variant.when


# --- the replayer finds what is wrong ------------------------------------------------------------------------

SYLVAC = TESTS / "transcripts" / "sylvac_optors.inch.txt"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (r'> "?\r"', r'> "?\n"'),  # sent otherwise
        (r'> "?\r"', r'> "?\r"' + '\n< "+1.00000\\r"\n' + r'> "?\r"'),  # asked less often
        (r"+1.00000\r", r"+1.00000\r+"),  # a byte left over
        (r"+1.00000\r", r"+1.00000"),  # a byte missing
        ("25.4 mm", "25.400001 mm"),
        ("25.4 mm", "25.4 degC"),
        ("= 25.4 mm", "! mismatch"),
        ("= 25.4 mm", "= 25.4 mm\n= 25.4 mm"),
    ],
)
def test_a_transcript_that_is_off_by_one_byte_fails(tmp_path: Path, old: str, new: str) -> None:
    text = SYLVAC.read_text(encoding="ascii")
    assert old in text
    path = tmp_path / SYLVAC.name
    path.write_text(text.replace(old, new, 1), encoding="ascii")
    with pytest.raises((AssertionError, pytest.fail.Exception, LineFault)):
        replay_transcript(path)
