"""A diagnosis in a terminal: the twelve lines, then the evidence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from compd.diagnosis.holdout import Holdout
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.error_fall import ErrorFall, error_fall
from compd.diagnosis.words.summary_lines import WIDTH, summary_lines
from compd.report.diagnosis_evidence import (
    candidates_table,
    constant_table,
    findings_table,
    formula_list,
    gross_rows_text,
    step_rows,
    untested_table,
    without_gain,
)
from compd.report.page_table import PageTable

# Findings that are listed; --json has them all.
SHOWN = 8
FORMULA_FILE = "described.yaml"


def print_diagnosis(console: Console, diagnosis: Diagnosis, holdouts: Sequence[Holdout]) -> None:
    """Print the twelve lines, a line, then each effect, what the rest follows, every candidate, and what comes next."""
    heading, *lines = summary_lines(diagnosis)
    console.print(Text(heading, style="bold"), soft_wrap=True)
    for line in lines:
        console.print(Text(line), soft_wrap=True)
    console.print("-" * WIDTH, soft_wrap=True)
    fall = error_fall(diagnosis)
    for holdout in holdouts:
        _paragraph(console, holdout.summary)
    for number, step in enumerate(diagnosis.steps):
        _heading(console, f"{number + 1}. {step.effect.id}: {step.effect.physics}")
        _print_pairs(console, step_rows(number, diagnosis, fall))
    _print_findings(console, diagnosis, fall)
    _print_constant(console, diagnosis, fall)
    if diagnosis.gross.rows:
        _heading(console, "Rows that do not count:")
        _paragraph(console, gross_rows_text(diagnosis, fall))
    _print_candidates(console, diagnosis, fall)
    _print_next(console, diagnosis)


def _print_findings(console: Console, diagnosis: Diagnosis, fall: ErrorFall) -> None:
    if not diagnosis.depends_on:
        return
    _heading(console, "What the rest follows: descriptions, no causes; on rows left out")
    table = findings_table(diagnosis, fall)
    _print_table(console, PageTable(table.head, table.rows[:SHOWN]))
    formulas = formula_list(diagnosis)
    if not formulas:
        return
    first = formulas.partition("id: ")[2].partition("\n")[0]
    recording = diagnosis.before.aligned.recording.path.name
    _heading(console, f"To lower the error until the cause is known, save this as {FORMULA_FILE} and add each:")
    command = f"compd effect add {FORMULA_FILE}:{first} --recording {recording} --model FILE"
    console.print(Text(command), soft_wrap=True)
    console.print(Text(formulas.rstrip("\n")), soft_wrap=True)


def _print_constant(console: Console, diagnosis: Diagnosis, fall: ErrorFall) -> None:
    table = constant_table(diagnosis, fall)
    if table is not None:
        _heading(console, "A constant in every row, which no effect is judged by:")
        _print_pairs(console, table.rows)


def _print_candidates(console: Console, diagnosis: Diagnosis, fall: ErrorFall) -> None:
    table = candidates_table(diagnosis, fall)
    if table.rows:
        _heading(console, "Effects that were tried, each alone, on rows left out:")
        _print_table(console, table)
    names = without_gain(diagnosis)
    if names:
        _heading(console, "Without gain:")
        _paragraph(console, ", ".join(names))
    untested = untested_table(diagnosis)
    if untested.rows:
        _heading(console, "Not testable on these rows:")
        _print_pairs(console, untested.rows)


def _print_next(console: Console, diagnosis: Diagnosis) -> None:
    if not diagnosis.next_measurement:
        return
    _heading(console, "Next")
    for row in diagnosis.next_measurement:
        if "measure" in row:
            _paragraph(console, f"{row['measure']}: {row['why']}" if row.get("why") else str(row["measure"]))
        else:
            console.print(Text("    " + ", ".join(f"{name} {value}" for name, value in row.items())), soft_wrap=True)
    path = diagnosis.before.aligned.recording.path
    for step in diagnosis.steps:
        if step.rivals and any("measure" not in row for row in diagnosis.next_measurement):
            pair = f"{step.effect.id},{step.rivals[0].name}"
            console.print(Text(f"    more: compd plan {path} --rivals {pair} --rows 40"), soft_wrap=True)


def _heading(console: Console, text: str) -> None:
    console.print()
    console.print(Text(text, style="bold"))


def _paragraph(console: Console, text: str) -> None:
    console.print(Padding(Text(text), (0, 0, 0, 4)))


def _print_pairs(console: Console, pairs: Iterable[Sequence[str]]) -> None:
    """Names and texts in two columns, without lines; an equation is wrapped under its own begin."""
    grid = Table.grid(padding=(0, 2))
    grid.add_column()
    grid.add_column(overflow="fold")
    for name, text in pairs:
        grid.add_row(Text(name), Text(text))
    console.print(Padding(grid, (0, 0, 0, 4)))


def _print_table(console: Console, table: PageTable) -> None:
    shown = Table(*table.head)
    for column, is_numeric in zip(shown.columns, table.numeric, strict=True):
        column.justify = "right" if is_numeric else "left"
    # an id is to be copied whole; a sentence leaves room for the other columns
    shown.columns[0].no_wrap = not any(" " in row[0] for row in table.rows)
    for row in table.rows:
        shown.add_row(*(Text(cell) for cell in row))
    console.print(shown)
