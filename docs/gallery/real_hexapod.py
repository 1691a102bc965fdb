"""A real hand-built hexapod, calibrated from two sessions of motion capture, where its recordings are at hand.

Its recordings belong to its owner. They lie beside the project, in ../shared/real/jugglebot, or nowhere.
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

import compd
from compd.arrays import FloatArray, rms
from compd.calibration import Calibration
from compd.machine_kinds import KINDS, machine_text
from compd.report import write_calibration_page

SESSIONS = Path(__file__).parents[3] / "shared" / "real" / "jugglebot"
NAME = "hand-built-hexapod"
TITLE = "A real hexapod, calibrated from its drawing"
PLAIN_BLOCKS = ("base_joint_position", "link_zero", "scale_gain")
GAIN_OF_EXTENSION = "scale_gain_change"
_DRAWING = re.compile(r"^\s+(base joints|platform joints|mm per turn)\s+(\[.*\])", re.MULTILINE)


class RealResult(NamedTuple):
    """Of the sealed session, in mm rms per leg: as drawn, with `PLAIN_BLOCKS`, with `GAIN_OF_EXTENSION` as well, and
    with all blocks that are needed (`calibration`)."""

    drawn_mm: float
    plain_mm: float
    with_gain_of_extension_mm: float
    full_mm: float
    calibration: Calibration


def drawing() -> dict[str, FloatArray]:
    """Joints and gains as the owner wrote them, by the names of his table."""
    text = (SESSIONS / "README.md").read_text(encoding="utf-8")
    return {name: np.array(yaml.safe_load(values)) for name, values in _DRAWING.findall(text)}


def machine(directory: Path) -> Path:
    """The drawing as a configuration in `directory`."""
    data = yaml.safe_load(
        machine_text("real", "6-ups", KINDS["6-ups"].usual).replace("{on: platform", '{"on": platform')
    )
    drawn = drawing()
    ends = zip(drawn["base joints"].tolist(), drawn["platform joints"].tolist(), strict=True)
    data["geometry"] |= {
        "rods": [
            {"actuator": i, "base_B_mm": base, "platform_P_mm": platform}
            for i, (base, platform) in enumerate(ends, start=1)
        ],
        "tool": {"on": "platform", "at_P_mm": [0, 0, 0], "zero_tip_M_mm": [0, 0, 565]},
        "tolerance_mm": "hand-built",
    }
    path = directory / "real.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


def recording(directory: Path, name: str) -> Path:
    """The session as it is: legs in mm, positions and quaternions, no times."""
    table = np.genfromtxt(SESSIONS / f"{name}.csv", delimiter=",", names=True)
    legs = np.stack([table[f"leg_length_{i}"] for i in range(1, 7)], axis=1) * drawing()["mm per turn"]
    columns = {f"scale_{i + 1}_mm": legs[:, i] for i in range(6)}
    columns |= {f"reference_{axis}_mm": table[f"position_{axis}"] for axis in "xyz"}
    columns |= {f"reference_q{part}": table[f"orientation_{part}"] for part in "xyzw"}
    path = directory / f"{name}.csv"
    rows = np.stack(list(columns.values()), axis=1).tolist()
    path.write_text("\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)]) + "\n")
    sidecar = {"machine": "real", "reference": {"quantity": "tool_pose", "frame": "instrument"}}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(sidecar))
    return path


def run_real_hexapod(pages: Path) -> RealResult | None:
    """Calibrate it and write NAME-calibration.html to `pages`; None where its recordings are not at hand."""
    if not SESSIONS.is_dir():
        return None
    with tempfile.TemporaryDirectory(prefix="compd-gallery-") as temporary:
        configuration = machine(Path(temporary))
        learned, sealed = (
            compd.open_recording(recording(Path(temporary), name), configuration) for name in ("poses-108", "poses-60")
        )
        plain = compd.calibrate(learned, sealed, blocks=PLAIN_BLOCKS)
        extended = compd.calibrate(learned, sealed, blocks=(*PLAIN_BLOCKS, GAIN_OF_EXTENSION))
        full = compd.calibrate(learned, sealed)
    write_calibration_page(pages / f"{NAME}-calibration.html", full)
    return RealResult(
        rms(full.sealed[0].before_links_mm),
        rms(plain.sealed[0].after_links_mm),
        rms(extended.sealed[0].after_links_mm),
        rms(full.sealed[0].after_links_mm),
        full,
    )


def real_hexapod_text(result: RealResult | None, picture_folder: str) -> str:
    """Its section of the gallery; picture_folder as in `gallery_text`."""
    if result is None:
        return f"## {TITLE}\n\nNot made here: its owner's recordings are not beside the project.\n"
    page = f"{NAME}-calibration.html"
    needed = ", ".join(f"`{block.name}`" for block in result.calibration.blocks if block.needed)
    errors = result.calibration.sealed[0]
    held_out = result.calibration.held_out[0]
    picture = [
        f"```{{figure}} {picture_folder}/{NAME}.png",
        f":target: {page}",
        f":alt: First screen of the calibration. {result.calibration.verdict}",
        ":class: screenshot",
        "```",
        "",
    ]
    lines = [
        f"## {TITLE}",
        "",
        "Nothing of this case is simulated: motion capture measured a hand-built 6-UPS whose legs are lines on spools. "
        "`compd calibrate` learned from 108 poses; 60 of another session took no part, and are registered.",
        "",
        *(picture if picture_folder else []),
        f'Full page with every number: <a href="{page}">calibration</a>.',
        "",
        "| numbers | legs on the 60 poses, mm rms |",
        "|---|---:|",
        f"| as drawn | {result.drawn_mm:.2f} |",
        f"| zeros, gains and base joints | {result.plain_mm:.3f} |",
        f"| these, and gains that change with extension | {result.with_gain_of_extension_mm:.3f} |",
        f"| all that held-out poses need: {needed} | {result.full_mm:.3f} |",
        "",
        f"What is left: {errors.after_rms_um:.0f} um at the tip and {errors.after_rms_urad:.0f} urad of attitude "
        f"on the 60 poses, rms per coordinate. Poses of the first session that were left out at random err by "
        f"{held_out.after_rms_um:.0f} um. {_noise(result.calibration)}",
        "",
    ]
    return "\n".join(lines)


def _noise(calibration: Calibration) -> str:
    if np.isnan(calibration.left_over):
        return "The sessions hold no repeats and no stated noise: how much of this is noise cannot be told."
    return f"That is {calibration.left_over**0.5:.1f} times the noise."
