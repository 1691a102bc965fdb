"""Find the physical effect that a machine's model lacks, add it, and see the error fall on other days.

    python examples/find_missing_effect.py [DIRECTORY] [NUMBER]

NUMBER hides one cause in a simulated tripod, chosen and sized by that number; this script does not know which. It is
learned from the campaign of the first days, and the result is tried on a campaign of other days, with other points,
weather and loads, on which nothing is fitted.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import compd

DAYS = {"first-days.csv": 0, "other-days.csv": 1}


def main(directory: Path, number: int) -> None:
    # 1. Measure twice on the same machine.
    for name, other_days in DAYS.items():
        compd.simulate_campaign(
            "tripod-cmm", directory / name, seed=5, hidden=number, other_days=other_days, overwrite=True
        )
    first_days, other_days = (compd.open_recording(directory / name) for name in DAYS)

    # 2. Something is missing: the error is far above the noise.
    print(compd.compare(first_days).verdict)

    # 3. Which effect is it? Every effect of the library is tried on rows that were left out of the fit.
    diagnosis = compd.diagnose(first_days)
    print(f"{diagnosis.verdict}: {diagnosis.summary}")

    # 4. Add what was found. Where the library has no such cause, take the formula that describes the error best.
    found = [step.effect for step in diagnosis.steps]
    formulas = [formula for finding in diagnosis.depends_on[:1] for formula in finding.formula_effects]
    model = None
    for effect in [*found, *formulas]:
        model = compd.add_effect(model, effect, first_days)
    if model is None:
        print("nothing to add")
        return
    for value in model.numbers():
        print(f"    {value.effect}: {value.parameter} = {value.value:.4g} +- {value.standard_error:.2g} {value.unit}")
    model.write(directory / "tripod.model.yaml")

    # 5. Has the error fallen where nothing was fitted?
    before, after = compd.compare(other_days), compd.compare(other_days, model)
    print(f"other days: {before.rms_um:.3f} um -> {after.rms_um:.3f} um, noise floor {after.floor.um:.3f} um")


if __name__ == "__main__":
    chosen = int(sys.argv[2]) if len(sys.argv) > 2 else 125
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]), chosen)
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary), chosen)
