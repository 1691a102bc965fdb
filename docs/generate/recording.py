"""The page of the recording's format: columns, sidecar, rules, ball plate, plan file."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

from compd import plan_file
from compd.columns import COLUMN_KINDS, DECIMALS
from compd.live.record import CYCLES_SUFFIX
from compd.recording import EXTERNAL, SECTIONS, ball_plate, checks, sidecar_contents, sidecar_text
from compd.recording.reference import Reference
from compd.recording.sidecar import Exclusion
from docs.generate.markdown import code, codes, escape, fence, heading, join, link, prose, table, term
from docs.generate.schema import ModelSchema

INTRODUCTION = f"""\
A {term("recording")} is what a machine's gauges showed, row by row, with or without a {term("reference")} instrument
beside it. It is two files: `NAME.csv` or `NAME.parquet`, one row per instant, and `NAME.yaml`, the sidecar. A
spreadsheet can write CSV; `compd recording start` writes either from the running daemon, and `compd recording join`
adds an instrument's export. `compd recording check NAME.csv` reports every mistake at once. See [join an
instrument](../how-to/join-an-instrument.md) and [record and replay](../how-to/record-and-replay.md).
"""
TABLE_RULES = """\
The CSV file has one header row, `,` between cells, `.` as the decimal mark, and is UTF-8. An empty cell is a missing
value. A column's name ends in its unit.

The Parquet file has the same columns: numbers (`double` is what compd writes), with `null` for an empty cell and the
unit again in the field's metadata (`unit`); the schema's metadata has `compd.format`. Columns of ids that hold text are
strings. Rows are numbered as in the CSV file, whose header is row 1. It needs `pip install 'compd[parquet]'`.
`compd recording convert` makes one into the other; the numbers stay the same to the last bit.
"""
EXTERNAL_MODEL = f"""\
With `machine: {EXTERNAL}` in the sidecar a column `model_...` stands beside every column `reference_...`: the
prediction of your own model. Neither gauges nor a configuration are needed then.

Anything else that was measured is a column `<name>_<unit>` in lower case, such as `flow_coolant_l_per_min`; a number
without unit ends in `_1`. `compd diagnose` tries every such column as an explanation of the error.
"""
CYCLES = f"""\
`compd recording start` also writes `NAME{CYCLES_SUFFIX}`: first the daemon's `VERSION` and its answer to `WATCH`, then
for every row the [`READINGS`](#protocol-readings) message as it came, line for line. Each message has all that its
cycle computed from, so `compd recording replay` computes the same setpoint again: bit for bit with the kernels that
`VERSION` names (`computed_by`), within 1e-12 mm with others. Model files that were in use are copied beside it.

`compd recording start --format parquet` writes the open part as `NAME.arrow`, an Arrow stream of the same columns,
which can be read to its last whole batch whatever ends the process; a part that is closed is `NAME.parquet`.
"""


def page() -> str:
    """Markdown, from the tables by which recordings are checked."""
    return join(
        "# Recording",
        INTRODUCTION,
        heading(2, "Columns", "recording-columns"),
        TABLE_RULES,
        table(
            ["column", "unit", "meaning"],
            [[codes(kind.names.split(", ")), kind.unit or "-", escape(kind.meaning)] for kind in COLUMN_KINDS],
        ),
        EXTERNAL_MODEL,
        "compd writes "
        + ", ".join(f"{unit} with {count} decimals" for unit, count in DECIMALS.items())
        + ", other units in full.",
        heading(2, "Sidecar", "recording-sidecar"),
        table(["key", "value", "meaning"], [_section_row(name, kind) for name, kind in SECTIONS.items()]),
        heading(3, "`reference`", "recording-sidecar-reference"),
        _keys(Reference),
        heading(3, "`excluded_rows`", "recording-sidecar-excluded"),
        _keys(Exclusion),
        "For example:",
        fence(sidecar_text(_example(), Path()), "yaml"),
        heading(2, "Rules and limits", "recording-rules"),
        prose((inspect.getdoc(checks) or "").partition("\n")[2]),
        table(
            ["columns", "plausible", "meaning"],
            [[_names(limit.names), f"{limit.low:g} to {limit.high:g}", escape(limit.why)] for limit in checks.LIMITS],
        ),
        heading(2, "Ball plate", "recording-ball-plate"),
        prose(inspect.getdoc(ball_plate) or ""),
        table(["column", "meaning"], [[code(name), escape(meaning)] for name, meaning in ball_plate.COLUMNS.items()]),
        heading(2, "Cycles for a replay", "recording-cycles"),
        CYCLES,
        heading(2, "Plan file", "recording-plan"),
        prose(inspect.getdoc(plan_file) or ""),
    )


def _names(names: str) -> str:
    return names if " " in names.replace(", ", "") else codes(names.split(", "))


def _section_row(name: str, kind: Any) -> list[str]:
    refer = {
        "Reference": link("`reference`", "recording-sidecar-reference"),
        "Exclusion": link("exclusions", "recording-sidecar-excluded"),
    }
    schema = ModelSchema(kind, refer.__getitem__)
    return [code(name), schema.type_text(schema.schema), escape(str(schema.schema["description"]))]


def _keys(kind: Any) -> str:
    keys = ModelSchema(kind).keys()
    return table(["key", "value", "meaning"], [[code(key.name), key.type_text, key.meaning] for key in keys])


def _example() -> dict[str, Any]:
    reference = Reference.model_validate({"quantity": "tool_position", "frame": "machine", "sigma_um": 0.15})
    return sidecar_contents(
        "tripod-cmm",
        {**reference.model_dump(include={"quantity", "frame"}), "sigma_um": reference.sigma_um[0]},
        {17: "the tracker's beam was cut"},
        notes="after the new air bearing",
    )
