"""The results as one page: families and measures against what is wanted, and every case that is not right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from compd.release import __version__
from docs.pictures import reliability as reliability_picture
from tests.scoreboard.commit import commits_text
from tests.scoreboard.families import FamilyScore, family_scores
from tests.scoreboard.measures import measures
from tests.scoreboard.reliability import UNSTATED, reliability
from tests.scoreboard.scoring import Result, Score

HERE = Path(__file__).parent
# Findings of what the rest follows that are shown.
SHOWN = 3


@dataclass(frozen=True)
class Miss:
    """A case that is not right. mark : near, dangerous or missed. hidden, said : lines. commands : to see it again."""

    case: str
    mark: str
    missing: str
    hidden: list[str]
    said: list[str]
    commands: str


@dataclass(frozen=True)
class Row:
    """A family's line, with its misses."""

    name: str
    meaning: str
    cases: int
    wanted: str
    right: str
    near: str
    dangerous: str
    falls_short: bool
    misses: list[Miss]


def write_page(path: Path, results: Sequence[Result], campaigns: Path) -> None:
    """Write the page; it works offline. campaigns : where the cases are kept, for the commands."""
    found = reliability(results)
    environment = Environment(loader=FileSystemLoader(HERE), autoescape=True, undefined=StrictUndefined)
    page = environment.get_template("page.html").render(
        title=f"compd {__version__}, commit {commits_text(results)}, {len(results)} cases.",
        families=[_row(scores, campaigns) for scores in family_scores(results)],
        measures=measures(results),
        reliability=found,
        diagram="" if found is None else reliability_picture.draw(found.as_json()),
        unstated=UNSTATED,
    )
    path.write_text(page, encoding="utf-8")


def _row(scores: FamilyScore, campaigns: Path) -> Row:
    return Row(
        scores.name,
        scores.meaning,
        scores.cases,
        "" if scores.wanted is None else f"{scores.wanted} %",
        f"{scores.right} ({scores.percent_right:.0f} %)",
        str(scores.near),
        str(scores.dangerous or ""),
        scores.wanted is not None and scores.percent_right < scores.wanted,
        [_miss(result, scored, campaigns) for result, scored in scores.misses],
    )


def _miss(result: Result, scored: Score, campaigns: Path) -> Miss:
    return Miss(
        result["case"],
        "dangerous" if scored.dangerous else "near" if scored.near else "missed",
        "; ".join(scored.missing),
        hidden_lines(result),
        said_lines(result["verdict"]),
        "\n".join(commands(result, campaigns)),
    )


def hidden_lines(result: Result) -> list[str]:
    """What was hidden, in words; what is expected where nobody hid anything."""
    answer, expected = result["answer"], result["expected"]
    floors = answer.get("error_in_floors", {})
    lines = [
        f"{name}: {_numbers(strength)} {answer['units'][name]}, {floors[name]:.2g} times the noise"
        for name, strength in answer["effects"].items()
    ]
    weak = answer.get("weak_disturbances", {})
    if weak:
        lines.append(f"two weak disturbances: {', '.join(weak)}")
    if change := expected.get("change"):
        lines.append(f"it begins or grows at {change['time_s']:.0f} s")
    lines += [f"to be named: {' or '.join(group)}" for group in expected.get("groups", ())]
    lines += [f"the rest follows {' or '.join(group)}" for group in expected.get("follows", ())]
    return lines or ["nothing"]


def said_lines(verdict: dict[str, Any]) -> list[str]:
    """The verdict, its steps and what the rest follows, as lines."""
    lines = [f"{verdict['verdict']}: {verdict['said']}"]
    for step in verdict["steps"]:
        parameters = ", ".join(f"{p['name']} = {_number(p['value'])} {p['unit']}" for p in step["parameters"])
        rivals = f"; or {', '.join(step['rivals'])}" if step["rivals"] else ""
        lines.append(f"{step['effect']} ({parameters}){rivals}")
    if constant := verdict.get("constant"):
        lines.append(f"a constant of {_numbers(list(constant['um'].values()))} um: {' or '.join(constant['effects'])}")
    for entry in verdict["depends_on"][:SHOWN]:
        what = entry.get("effect") or entry.get("covariate")
        when = "" if entry.get("time_s") is None else f" at {entry['time_s']:.0f} s"
        lines.append(f"the rest follows {what}: {entry['form']}{when}")
    return lines


def commands(result: Result, campaigns: Path) -> list[str]:
    """The commands that make the case's recordings again and diagnose them."""
    directory = campaigns / result["directory"]
    options = "".join(
        f" --{name} {directory / name}.yaml" for name in ("machine", "effects") if (directory / f"{name}.yaml").exists()
    )
    return [
        f"python -m tests.scoreboard --case '{result['case']}' --campaigns {campaigns} --out again.jsonl",
        f"compd diagnose {directory / 'train.csv'} {directory / 'other.csv'}{options}",
    ]


def _numbers(values: Any) -> str:
    return ", ".join(map(_number, values)) if isinstance(values, list) else _number(values)


def _number(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.3g}"
