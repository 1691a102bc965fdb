"""A diagnosis in a terminal: the twelve lines, then the evidence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from compd.diagnosis import WIDTH, Diagnosis, ErrorFall, Holdout, error_fall, summary_lines
from compd.plan_file import PURPOSE_COLUMN
from compd.report.diagnosis_evidence import (
    candidates_table,
    constant_table,
    findings_table,
    formula_list,
    next_table,
    plan_command,
    step_rows,
    untested_table,
    without_gain,
    wrong_data,
)
from compd.report.page_table import PageTable

# Two spaces and a line for each column, and the first line.
_CELL_FRAME, _FIRST_LINE = 3, 1


def keep_words_whole(table: Table, width: int) -> Table:
    """The table with columns wide enough to break lines between words only; `width`: of the terminal.

    Where a table is wider than the terminal, rich cuts words, but not in a column that has a width. What is left over
    goes to the columns whose texts are longest. Where even the words need more, the lines between columns go.
    """
    texts = [[_plain(column.header), *map(_plain, column.cells)] for column in table.columns]
    whole = [max(len(line) for text in column for line in text.split("\n")) for column in texts]
    words = [max((len(word) for text in column for word in text.split()), default=0) for column in texts]
    widths = [whole[k] if column.no_wrap else words[k] for k, column in enumerate(table.columns)]
    left = width - sum(widths) - _CELL_FRAME * len(widths) - _FIRST_LINE
    if left < 0:
        table.box = None
        left += len(widths) + _FIRST_LINE
    while left > 0 and widths != whole:
        narrowest = max(range(len(widths)), key=lambda k: whole[k] / max(widths[k], 1))
        widths[narrowest] += 1
        left -= 1
    for column, cells in zip(table.columns, widths, strict=True):
        column.width = cells
    return table


def _plain(cell: object) -> str:
    return cell.plain if isinstance(cell, Text) else Text.from_markup(str(cell)).plain


# Most listed findings; --json has all.
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
    if texts := wrong_data(diagnosis, fall):
        _heading(console, "What is wrong with the data:")
    for text in texts:
        _paragraph(console, text)
    _print_candidates(console, diagnosis, fall)
    _print_next(console, diagnosis)
    if basis := diagnosis.before.basis:
        _paragraph(console, basis)


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
    command = f"compd model add {FORMULA_FILE}:{first} --recording {recording} --model FILE"
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
    planned = not any("measure" in row for row in diagnosis.next_measurement)
    table = next_table(diagnosis)
    if planned and table is not None:
        _print_planned_rows(console, table)
        if table.caption:
            _paragraph(console, table.caption)
    else:
        for row in diagnosis.next_measurement:
            _paragraph(console, f"{row['measure']}: {row['why']}" if row.get("why") else str(row["measure"]))
    for step in diagnosis.steps:
        if step.rivals and planned:
            console.print(Text(f"    more: {plan_command(diagnosis, step)}"), soft_wrap=True)


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


def _print_planned_rows(console: Console, table: PageTable) -> None:
    """The purpose in the first of its rows only."""
    shown = Table(*table.head, box=SIMPLE_HEAD)
    for column, name in zip(shown.columns, table.head, strict=True):
        column.justify = "left" if name == PURPOSE_COLUMN else "right"
    last = ""
    for row in table.rows:
        cells = dict(zip(table.head, row, strict=True))
        purpose = cells.get(PURPOSE_COLUMN, "")
        if PURPOSE_COLUMN in cells and purpose == last:
            cells[PURPOSE_COLUMN] = ""
        last = purpose
        shown.add_row(*map(Text, cells.values()))
    console.print(keep_words_whole(shown, console.width))


def _print_table(console: Console, table: PageTable) -> None:
    shown = Table(*table.head)
    for column, is_numeric in zip(shown.columns, table.numeric, strict=True):
        column.justify = "right" if is_numeric else "left"
    for row in table.rows:
        shown.add_row(*(Text(cell) for cell in row))
    console.print(keep_words_whole(shown, console.width))
