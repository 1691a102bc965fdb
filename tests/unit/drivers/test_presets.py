"""Described gauges: a YAML file and its transcript are all that a new one needs; what is wrong in a file is named."""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import ValidationError

from compd.conformance import driver_under_test, run_conformance
from compd.errors import PluginError
from compd.gauge_tools import catalogue, driver_description
from compd.plugins import GAUGES, SIMULATED_GAUGES, load, names
from compd_drivers.preset_directory import PresetDirectory
from tests.support.paths import ROOT
from tests.support.sampled import sampled
from tests.support.transcripts import check_simulated_device, replay_transcript

# Gauges that do not exist, one at least on each protocol: the preset, and its transcript.
MADE_UP = {
    "dial_100": (
        r"""
title: "Dial 100: a dial gauge on RS-232."
delivers: One dial, one channel `position` in mm.
source: |
  a manual that does not exist, page 7: 9600 baud, 8N1; `?` CR is answered by sign, three digits, point, CR.

base: serial_ascii
line: {baud: 9600, format: 8N1}
options:
  unit: {one_of: [mm, inch], description: what the dial shows; it does not say}
  range_mm: {like: channels.range, default: null, description: "[lowest, highest] it can measure"}
gauge:
  out: "?"
  out_terminator: '\r'
  in_terminator: '\r'
  channels: [{name: position, unit: "{unit}", range: "{range_mm}"}]
  errors: [{in: E1, quality: sensor_fault, says: no probe}]
variants:
  - {when: {unit: mm}, gauge: {in: "%+08.3f"}}
  - {when: {unit: inch}, gauge: {in: "%+08.5f"}}
sample: {unit: mm}
""",
        r"""options {unit: inch}

# page 7: sign, one digit, point, five digits
> "?\r"
<* "+0.05000\r"
= 1.27 mm
> "?\r"
<* "E1\r"
= sensor_fault
> "?\r"
< "+0.0500\r"
! mismatch
""",
    ),
    "gap_2": (
        r"""
title: "Gap 2: an eddy current probe on RS-485."
delivers: One probe, one channel `gap` in mm.
source: |
  a manual that does not exist, page 12.

base: serial_frame
options:
  address: {whole: [1, 31], description: of the probe}
gauge:
  out: "02 {address:02X} 4D CS"
  out_checksum: {kind: xor8}
  frame: "02 {address:02X} .. .. CS"
  checksum: {kind: xor8}
  channels: [{name: gap, at: 2, type: int16, byte_order: big, unit: um, scale: 0.1, invalid: {32767: sensor_fault}}]
sample: {address: 17}
""",
        r"""options {address: 17}

# page 12: 1000 counts of 0.1 um
> 02 11 4D 5E
<* 02 11 03 E8 F8
= 0.1 mm
> 02 11 4D 5E
<* 02 11 7F FF 93
= sensor_fault
> 02 11 4D 5E
< 02 11 03 E9 F8
! crc
""",
    ),
    "thermo_2": (
        r"""
title: "Thermo 2: two thermometers on Modbus RTU."
delivers: One module, the chosen ones of its channels `top` and `bottom` in degC.
source: |
  a manual that does not exist, page 3.

base: modbus
options:
  unit: {whole: [1, 247], description: slave address}
  sensors: {some_of: [top, bottom], description: those that are wired}
chosen_channels: sensors
gauge:
  channels:
    - {name: top, function: 4, address: 0, type: int16, scale: 0.01, unit: degC, invalid: [-32768]}
    - {name: bottom, function: 4, address: 1, type: int16, scale: 0.01, unit: degC, invalid: [-32768]}
sample: {unit: 1, sensors: [top, bottom]}
""",
        r"""options {unit: 1, sensors: [bottom]}

# page 3: 2000 counts of 0.01 degC
> 01 04 00 01 00 01 60 0A
<* 01 04 02 07 D0 BA 9C
= 20 degC
> 01 04 00 01 00 01 60 0A
< 01 84 02 C2 C1
! device_error
""",
    ),
    "gap_7": (
        r"""
title: "Gap 7: an eddy current probe on Modbus RTU."
delivers: One probe, one channel `gap` in mm.
source: |
  a manual that does not exist, page 31: register 100 holds the type, 40, register 101 the serial number.

base: modbus
options:
  unit: {whole: [1, 247], description: slave address}
  serial_number: {whole: [0, 65535], description: on the label of the probe}
gauge:
  identity: {function: 3, address: 100, equals: [40, "{serial_number}"]}
  channels:
    - {name: gap, function: 4, address: 0, type: int32, scale: 0.00001, unit: mm, lowest: -1, highest: 1}
sample: {unit: 1, serial_number: 10483}
""",
        r"""options {unit: 1, serial_number: 10483}

# page 31: the type and the serial number, then 10000 counts of 10 nm
> 01 03 00 64 00 02 85 D4
<* 01 03 04 00 28 28 F3 24 7E
> 01 04 00 00 00 02 71 CB
<* 01 04 04 00 00 27 10 E1 B8
= 0.1 mm

# after a fault it is asked again who it is: another probe has no values
> 01 04 00 00 00 02 71 CB
< 01 84 04 42 C3
! device_error
> 01 03 00 64 00 02 85 D4
< 01 03 04 00 28 28 F4 65 BC
! mismatch
""",
    ),
}


@pytest.fixture
def made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package of presets as pip installs it; gives the folder of their transcripts."""
    package = tmp_path / "made_up_presets"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from importlib.resources import files\n"
        "from compd_drivers.preset_directory import PresetDirectory\n"
        "directory = PresetDirectory(files(__name__))\n"
    )
    information = tmp_path / "made_up_presets-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: made-up-presets\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[compd.gauge_presets]\nmade_up = made_up_presets:directory\n")
    transcripts = tmp_path / "transcripts"
    transcripts.mkdir()
    for name, (preset, transcript) in MADE_UP.items():
        (package / f"{name}.yaml").write_text(preset)
        (transcripts / f"{name}.txt").write_text(transcript)
    monkeypatch.syspath_prepend(tmp_path)
    yield transcripts
    sys.modules.pop("made_up_presets", None)


@pytest.mark.parametrize("name", sampled(MADE_UP, 4))
def test_a_yaml_file_and_its_transcript_are_a_new_gauge(made_up: Path, name: str) -> None:
    assert name in names(GAUGES)
    assert name in names(SIMULATED_GAUGES)
    replay_transcript(made_up / f"{name}.txt")
    check_simulated_device(made_up / f"{name}.txt")
    results = [result for _, result in run_conformance(driver_under_test(name), on_real_wires=False)]
    assert [result for result in results if result.verdict == "FAIL"] == []
    assert sum(result.verdict == "pass" for result in results) >= 12


def test_a_preset_is_listed_and_shown_like_any_driver(made_up: Path) -> None:
    entry = next(entry for entry in catalogue() if entry.name == "dial_100")
    assert (entry.title, entry.needed_options, entry.simulated) == (
        "Dial 100: a dial gauge on RS-232.",
        ("unit",),
        True,
    )
    description = driver_description("dial_100")
    assert "page 7" in description.text
    assert {option.name: option.meaning for option in description.options}[
        "range_mm"
    ] == "[lowest, highest] it can measure"
    assert load(GAUGES, "dial_100", "x").usual_line == (9600, "8N1")


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({}, "unit"),
        ({"unit": "um"}, "'mm' or 'inch'"),
        ({"unit": "mm", "range_mm": [1, -1]}, "lowest"),
        ({"unit": "mm", "decimals": 3}, "decimals"),
    ],
)
def test_options_that_cannot_be_right(made_up: Path, options: dict[str, object], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        load(GAUGES, "dial_100", "x").Options.model_validate({"driver": "dial_100", "line": "l", **options})


def test_the_example_in_the_guide_is_a_preset(tmp_path: Path) -> None:
    guide = (ROOT / "drivers" / "compd_drivers" / "presets" / "README.md").read_text()
    first, last = guide.index("    title:"), guide.index("An option is")
    (tmp_path / "dial.yaml").write_text(textwrap.dedent(guide[first:last]))
    presets = PresetDirectory(tmp_path)
    assert presets.driver("dial").sample_options == {"unit": "mm"}
    assert presets.simulated_device("dial")


def test_what_is_wrong_for_the_simulated_device_is_named_too(tmp_path: Path) -> None:
    preset = MADE_UP["dial_100"][0] + "simulated: {extra_input: sometimes}\n"
    (tmp_path / "dial.yaml").write_text(preset)
    with pytest.raises(PluginError, match=r"dial\.yaml:\d+ simulated\.extra_input"):
        PresetDirectory(tmp_path).simulated_device("dial")


@pytest.mark.parametrize(
    ("old", "new", "where", "what"),
    [
        ("base: serial_ascii", "base: serial_latin", r"dial\.yaml:\d+ base", "no such driver"),
        ("title:", "titel:", r"dial\.yaml:\d+ titel", "unknown key"),
        ("format: 8N1", "format: 9X1", r"dial\.yaml:\d+ line\.format", "pattern"),
        ('unit: "{unit}"', 'unit: "{unnit}"', r"dial\.yaml", "no option `unnit`"),
        ("like: channels.range", "like: channels.extent", r"dial\.yaml:\d+ options", "channels.extent"),
        ("one_of: [mm, inch], ", "", r"dial\.yaml:\d+ options\.unit", "exactly one of"),
        ("quality: sensor_fault", "quality: broken", r"dial\.yaml:\d+ gauge\.errors\[1\]\.quality", "sensor_fault"),
        ("when: {unit: mm}", "when: {unit: um}", r"dial\.yaml:\d+ sample", "unit mm is not described"),
        ('"%+08.3f"', '"%+08q"', r"dial\.yaml:\d+ gauge", "not a converter"),
        ("sample: {unit: mm}", "sample: {unit: mil}", r"dial\.yaml:\d+ sample\.unit", "'mm' or 'inch'"),
        ("delivers:", "title: again\ndelivers:", r"dial\.yaml:\d+", "title"),
    ],
)
def test_what_is_wrong_in_a_file_is_named_with_its_place(
    tmp_path: Path, old: str, new: str, where: str, what: str
) -> None:
    preset = MADE_UP["dial_100"][0]
    assert old in preset
    (tmp_path / "dial.yaml").write_text(preset.replace(old, new, 1))
    with pytest.raises(PluginError, match=what) as caught:
        PresetDirectory(tmp_path).driver("dial")
    assert any(re.search(where, problem.where) for problem in caught.value.problems), caught.value


def test_only_devices_that_measure_where_their_sensor_is_are_absolute() -> None:
    absolute = {name for name in names(GAUGES) if load(GAUGES, name, name).absolute}
    assert absolute == {"adam_4017p", "icpdas_m7017c", "microepsilon_msc7", "moxa_e1240"}
