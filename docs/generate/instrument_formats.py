"""The page of instrument formats: what `compd recording join` reads, and the forms that `compd sim tracker` writes."""

from __future__ import annotations

from compd.instruments import instrument_formats, written_forms
from docs.generate.markdown import code, escape, heading, join, sentence, table

INTRODUCTION = """\
`compd recording join` reads the export of an instrument in any of these formats. It recognises the format by the
content of the file, and prints it. See [join an instrument](../how-to/join-an-instrument.md).
"""
WRITTEN = """\
`compd sim tracker` lets the simulated instrument write an export in any of these forms.
"""
# Between these lines the how-to guide includes the table.
BEGIN, END = "<!-- formats: begin -->", "<!-- formats: end -->"


def page() -> str:
    """Markdown, from the declarations of the formats."""
    formats = [
        [code(declared.name), declared.file_is, f"`{declared.ending}`", declared.finds]
        for declared in instrument_formats().values()
    ]
    forms = [
        [code(form.name), escape(sentence(form.summary)), " or ".join(", ".join(axes) for axes in form.axes)]
        for form in written_forms().values()
    ]
    return join(
        "# Instrument formats",
        INTRODUCTION,
        heading(2, "Formats that are read", "instrument-formats-read"),
        BEGIN,
        table(["`--as`", "what it is", "usual ending", "what is found in it"], formats),
        END,
        heading(2, "Forms that the simulated instrument writes", "instrument-formats-written"),
        WRITTEN,
        table(["`--as`", "what is written", "columns"], forms),
    )
