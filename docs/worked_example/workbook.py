"""The whole spreadsheet: from the residual of each row to the word of the verdict, every step a formula."""

from __future__ import annotations

from docs.worked_example.example import Example
from docs.worked_example.loss_sheets import write_folds, write_losses, write_sums
from docs.worked_example.noise_sheets import write_noise, write_weights
from docs.worked_example.recording_sheets import write_criteria, write_readme, write_rows
from docs.worked_example.sheets import Sheets
from docs.worked_example.verdict_sheets import write_blocks, write_verdict

# In the order in which they are read, each made of those before it.
SHEETS = (
    write_readme,
    write_criteria,
    write_rows,
    write_noise,
    write_weights,
    write_sums,
    write_folds,
    write_losses,
    write_blocks,
    write_verdict,
)


def make_sheets(example: Example) -> Sheets:
    """The spreadsheet of an example."""
    sheets = Sheets(example)
    for write in SHEETS:
        write(sheets)
    return sheets
