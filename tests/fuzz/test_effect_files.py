"""An effect file with any formula is diagnosed or refused in words, as `compd diagnose --effects` does it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import compd
from compd.comparison import AlignedRecording
from compd.errors import CompdError
from tests.fuzz.bounds import is_told, refusal

COLUMNS = ("temperature_ram_degC", "humidity_pct", "model_y_mm", "time_s")
UNITS = ("um", "um/K", "mm", "ppm/K", "1", "arcsec", "um/pct", "s", "K", "furlong")
CALLS = ("sin", "cos", "exp", "sqrt", "log", "abs", "sign", "tan", "atan2", "minimum", "maximum", "lag")
NUMBERS = ("0", "1", "2", "400", "1e-3", "1e300", "1e-300", "20", "pi")
# Forms that people write, each with a sum of numbers or of unlike terms in it.
FORMS = (
    "k * (1 - cos(model_y_mm))",
    "k * (1 - 1)",
    "k / (2 - 2)",
    "k * (cos(model_y_mm) - 1) ** -1",
    "k * (model_y_mm + humidity_pct)",
    "k * (1e300 * 1e300) * temperature_ram_degC",
    "k * time_s ** 9 ** 9",
    "k * abs(-1e300)",
    "k * exp(300 + model_y_mm)",
    "k * (-2) ** 0.5 * model_y_mm",
    "k * 0 ** -1",
    "k * sqrt(-2 * model_y_mm)",
    "k * (1 - sqrt(2)) * (3 + cos(humidity_pct)) / (1 - 1)",
)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    """40 rows of a machine that compd does not know."""
    path = tmp_path_factory.mktemp("effects") / "day.csv"
    rng = np.random.default_rng(1)
    time_s = 5.0 * np.arange(40)
    ram_degC = 20 + 3 * np.sin(time_s / 40)
    place_mm = rng.uniform(-100, 100, (40, 3))
    seen_mm = place_mm + 1e-3 * rng.standard_normal((40, 3)) - np.outer(4e-3 * (ram_degC - 20), [0, 0, 1])
    columns = np.column_stack([time_s, np.arange(40) // 2, ram_degC, rng.uniform(40, 50, 40), place_mm, seen_mm])
    names = ["time_s", "visit", "temperature_ram_degC", "humidity_pct"]
    names += [f"{what}_{axis}_mm" for what in ("model", "reference") for axis in "xyz"]
    np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    sidecar = {"format": 3, "machine": "external", "reference": {"quantity": "tool_position", "frame": "machine"}}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(sidecar), encoding="utf-8")
    return compd.open_recording(path)


def expression(rng: np.random.Generator, depth: int = 4) -> str:
    """A formula as the language has them."""
    if depth == 0 or rng.random() < 0.25:
        return str(rng.choice([*COLUMNS, "k", "j", *NUMBERS]))
    inside = [expression(rng, depth - 1) for _ in range(2)]
    match int(rng.integers(4)):
        case 0:
            name = str(rng.choice(CALLS))
            inside = inside[: 1 + (name in ("minimum", "maximum", "lag", "atan2"))]
            return f"{name}({', '.join(inside)})"
        case 1:
            return f"-({inside[0]})"
        case 2:
            return f"({inside[0]}) ** {rng.choice(['2', '-1', '0.5', '7', '-0.5'])}"
        case _:
            return f"({inside[0]}) {rng.choice(['+', '-', '*', '/'])} ({inside[1]})"


def diagnosed(measured: AlignedRecording, directory: Path, formula: str, unit: str) -> CompdError | None:
    """The refusal of an effect, or None where it is diagnosed."""
    number = {"unit": unit, "plausible": [-12, 12], "source": "notes"}
    parameters = {name: number for name in "kj" if name in formula} or {"k": number}
    effect = {"id": "mine", "port": "reference", "axis": "z", "formula": formula, "parameters": parameters}
    path = directory / "effects.yaml"
    path.write_text(yaml.safe_dump(effect), encoding="utf-8")
    return refusal(lambda: str(compd.diagnose(measured, effects=path)), CompdError)


@pytest.mark.parametrize("formula", FORMS)
def test_sums_of_numbers_and_of_unlike_terms_end_in_words(
    formula: str, measured: AlignedRecording, tmp_path: Path
) -> None:
    assert is_told(diagnosed(measured, tmp_path, formula, "um"))


def test_random_formulas_end_in_words(measured: AlignedRecording, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    for _ in range(30):
        assert is_told(diagnosed(measured, tmp_path, f"k * ({expression(rng)})", str(rng.choice(UNITS))))


@pytest.mark.long
def test_many_random_formulas_end_in_words(measured: AlignedRecording, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    for _ in range(400):
        text = expression(rng, 5)
        assert is_told(
            diagnosed(measured, tmp_path, text if rng.random() < 0.3 else f"k * ({text})", str(rng.choice(UNITS)))
        )
