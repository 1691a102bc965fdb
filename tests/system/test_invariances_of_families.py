"""The same relations on every kind of recording: whatever a diagnosis says, right or wrong, it says again.

One case of each family of the scoreboard, the examples, the gallery, and real recordings where they are at hand. Each
is diagnosed as it is, and again with another origin of time, other units, rows and columns in another order or twice,
and an instrument that stands elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from compd.diagnosis import Diagnosis
from tests.scoreboard.trial import diagnose_case
from tests.support.changed_recordings import (
    Change,
    double_columns,
    double_rows,
    in_other_units,
    move_origin,
    shuffle_columns,
    shuffle_rows,
    turn_frame,
)
from tests.support.prepared_recordings import read_case, sources, write_case
from tests.support.same_diagnosis import assert_same

SOURCES = sources()
TIME, OTHER_UNITS = "another origin of time", "quantities in other units"
RELATIONS: Mapping[str, Change] = {
    TIME: move_origin(1_795_000_000.0),
    "rows in another order": shuffle_rows(1),
    "rows twice": double_rows,
    "columns in another order": shuffle_columns(2),
    "columns twice": double_columns,
    OTHER_UNITS: in_other_units,
    "a turned instrument": turn_frame(-70.0, 25.0, 133.0, shift_mm=(-40.0, 900.0, 12.0)),
}
# With quantities that the format does not know, so that they may have any unit.
HAVE_OWN_QUANTITIES = (
    *("family plane", "family distractors", "example external_machine.py", "real voron-frame-expansion"),
    *("real voron-run-3", "real probe_GX_H8A"),
)
# Measured in an instrument's frame.
BY_AN_INSTRUMENT = ("family unregistered",)
# Rows at rest without a time.
WITHOUT_TIME = ("example arm_parameters.py", "real plug-plate-1597A-2011", "real telescope-pointing-2022")
# Of `make test`: made and diagnosed within a second.
SAMPLE = ("family rounded", "family plane")


def relations(name: str) -> Iterator[str]:
    """The relations that hold for a recording."""
    for relation in RELATIONS:
        wanted = {
            TIME: name not in WITHOUT_TIME,
            OTHER_UNITS: name in HAVE_OWN_QUANTITIES,
            "a turned instrument": name in BY_AN_INSTRUMENT,
        }
        if wanted.get(relation, True):
            yield relation


def parameters() -> Iterator[object]:
    for name in SOURCES:
        marks = [] if name in SAMPLE else [pytest.mark.long]
        yield from (pytest.param(name, relation, id=f"{name}: {relation}", marks=marks) for relation in relations(name))


class Original(NamedTuple):
    """A recording before it is changed."""

    directory: Path
    diagnosis: Diagnosis


@pytest.fixture(scope="module")
def original_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Original]:
    """The original by name; each is made and diagnosed once."""

    @cache
    def original(name: str) -> Original:
        directory = SOURCES[name](tmp_path_factory.mktemp("original"))
        return Original(directory, diagnose_case(directory)[0])

    return original


@pytest.mark.parametrize(("name", "relation"), list(parameters()))
def test_the_diagnosis_stays_the_same(
    name: str, relation: str, original_of: Callable[[str], Original], tmp_path: Path
) -> None:
    directory, before = original_of(name)
    changed = RELATIONS[relation](read_case(directory))
    after, _ = diagnose_case(write_case(changed, directory, tmp_path))
    assert_same(before, after)
