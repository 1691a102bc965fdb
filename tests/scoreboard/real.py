"""Recordings of real machines, beside the project: what an honest analysis finds is known from their authors."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from compd.configuration import shipped_effects
from tests.scoreboard.expectation import Expectation
from tests.support.paths import SHARED

PLACE = SHARED / "real"
FAMILY = "real"
# "... with ia ie an aw in the model": effects that the model has already.
_WITH, _IN_THE_MODEL = " with ", " in the model"
# Where nobody planted anything, any word but these may be right if the answers do not say.
_WORDS = ("identified", "likely", "ambiguous", "partial", "unexplained")
# "never: [... alone]": not without a rival.
_ALONE = " alone"


def prepare_real(campaigns: Path, place: Path = PLACE) -> list[Path]:
    """Directories of the real recordings of `place`; none where that is absent."""
    answers = place / "answers.yaml"
    if not answers.exists():
        return []
    entries: Mapping[str, Any] = yaml.safe_load(answers.read_text(encoding="utf-8"))
    return [_prepare(name, dict(entry), campaigns, place) for name, entry in entries.items()]


def _prepare(name: str, entry: dict[str, Any], campaigns: Path, place: Path) -> Path:
    recording, _, model = name.partition(_WITH)
    directory = campaigns / f"{FAMILY}_{name.replace(' ', '-')}"
    directory.mkdir(parents=True, exist_ok=True)
    for suffix in (".csv", ".yaml"):
        _link(place / f"{recording}{suffix}", directory / f"train{suffix}")
    if library := entry.pop("library"):
        _link(shipped_effects().get(library, place / library), directory / "effects.yaml")
    known = model.removesuffix(_IN_THE_MODEL).split()
    if known:
        (directory / "known.json").write_text(json.dumps(known), encoding="utf-8")
    entry["verdicts"] = _with_likely(entry.pop("verdict", _WORDS))
    entry["groups"] = entry.pop("right", ())
    entry["may_name"] = tuple(_flat(entry.pop("beside", ())))
    never = entry.pop("never", ())
    # a word that is not among the verdicts is not right in any case
    entry["never"] = [name for name in never if not name.endswith(_ALONE)]
    alone = [name.removesuffix(_ALONE) for name in never if name.endswith(_ALONE)]
    entry["never_alone"] = [*entry.pop("never_alone", ()), *alone]
    answer = {
        "case": f"{FAMILY}:{name}",
        "family": FAMILY,
        "effects": {},
        "known": known,
        "expected": Expectation.from_json(entry).as_json(),
    }
    (directory / "answer.json").write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")
    return directory


def _with_likely(words: Sequence[str]) -> list[str]:
    """Where `identified` is right, so is the word for the same with less certainty."""
    return [*words, *(["likely"] if "identified" in words and "likely" not in words else [])]


def _flat(groups: Sequence[Any]) -> Iterator[str]:
    for group in groups:
        yield from [group] if isinstance(group, str) else group


def _link(source: Path, target: Path) -> None:
    """A link in place of a copy: the recordings are not the project's."""
    target.unlink(missing_ok=True)
    target.symlink_to(source.resolve())
