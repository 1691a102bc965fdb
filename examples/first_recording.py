"""A first recording: how far apart are the machine and its model, and what do the comparators contribute?

    python examples/first_recording.py [DIRECTORY]

The recording comes from a simulated tripod, as a measuring campaign on a real one would bring it home: one row per
measured point with the readings of all gauges and the tip's place as a laser tracker saw it. With a recording of your
own, leave `simulate_campaign` out and give your file to `open_recording`.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import compd


def main(directory: Path) -> None:
    # 1. Measure. The files first.csv and first.yaml are written; the machine has nothing that its gauges do not see.
    compd.simulate_campaign("tripod-cmm", directory / "first.csv", seed=3, overwrite=True)

    # 2. Open the recording. The sidecar first.yaml names the machine, whose configuration comes with compd. In each
    #    row the kinematics computes the tip from the gauges.
    recording = compd.open_recording(directory / "first.csv")
    print(recording)

    # 3. Compare the computed tip with the measured one.
    comparison = compd.compare(recording)
    print(comparison.verdict)
    for axis, error_um, noise_um in zip(
        recording.labels, comparison.rms_by_axis_um, comparison.floor.by_axis_um, strict=True
    ):
        print(f"    {axis}: {error_um:.2f} um, of which noise {noise_um:.2f} um")
    print(f"Noise floor: {comparison.floor.how}.")

    # 4. What would the error be without the comparators in the joints, and without those on the frame?
    for source, part in comparison.contributions.items():
        print(f"error without compensation of the {source}: {part.without_rms_um:.2f} um")
    print(f"error with both: {comparison.rms_um:.2f} um, noise floor {comparison.floor.um:.2f} um")

    # 5. Rows that do not count, each with its reason.
    for row, why in zip(recording.recording.row, comparison.why_left_out, strict=True):
        if why:
            print(f"row {row} is left out: {why}")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
