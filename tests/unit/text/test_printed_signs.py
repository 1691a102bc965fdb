"""Texts as pages show them: units with Greek letters; names and options stay."""

from __future__ import annotations

import pytest

from compd.text import typeset


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("0.12 um.", "0.12 µm."),
        ("1.9 -> 0.2 um (rms)", "1.9 → 0.2 µm (rms)"),
        ("0.884 +- 0.02 um/K, 3 urad", "0.884 ± 0.02 µm/K, 3 µrad"),
        ("N/um", "N/µm"),
        ("0.884, 1.103 (+- 0.020) um", "0.884, 1.103 (± 0.020) µm"),
        ("22 degC", "22 °C"),
        ("tip_x_um and um_per_m", "tip_x_um and um_per_m"),
        ("--noise-um 0.2, album, um.csv, um=3", "--noise-um 0.2, album, um.csv, um=3"),
    ],
)
def test_units_are_shown_and_names_stay(text: str, shown: str) -> None:
    assert typeset(text) == shown
