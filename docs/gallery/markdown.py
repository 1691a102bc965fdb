"""The gallery's text, made from the results."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from compd.model.library import load_library
from compd.simulation.causes.catalogue import CAUSES
from compd.text import typeset
from docs.gallery.cases import DIAGNOSE_COMMAND
from docs.gallery.result import Result


def gallery_text(results: Sequence[Result], picture_folder: str) -> str:
    """Markdown: a table of all cases, then each case.

    picture_folder : where NAME.png are, seen from the page; "" where there are no pictures.
    """
    rows = [
        f"| [{result.case.title}](#{_anchor(result.case.title)}) | {result.verdict} | {result.before_um:.2f} | "
        f"{result.after_um:.2f} | {result.floor_um:.2f} |"
        for result in results
    ]
    head = ["| case | verdict | before, µm | after, µm | noise, µm |", "|---|---|---:|---:|---:|"]
    cases = [line for result in results for line in _case(result, picture_folder)]
    return "\n".join([*head, *rows, "", *cases])


def _case(result: Result, picture_folder: str) -> list[str]:
    name = result.case.name
    diagnosis, comparison = f"{name}-diagnosis.html", f"{name}-comparison.html"
    lines = [f"## {result.case.title}", "", result.case.look_at, ""]
    if picture_folder:
        lines += [
            f"```{{figure}} {picture_folder}/{name}.png",
            f":target: {diagnosis}",
            f":alt: First screen of the diagnosis. {result.summary}",
            ":class: screenshot",
            "```",
            "",
        ]
    learned = "the formula that the page proposes" if result.described else "what was named"
    commands = [result.case.campaign_command, result.case.other_days_command, DIAGNOSE_COMMAND]
    lines += [
        f'Full pages with every figure: <a href="{diagnosis}">diagnosis</a>, <a href="{comparison}">comparison</a>.',
        "",
        f"- **Verdict**: {result.verdict}. {typeset(result.summary)}",
        f"- **What was hidden**: {_hidden(result)}",
        f"- **Error on other days**: {result.before_um:.2f} µm before, {result.after_um:.2f} µm after with {learned}; "
        f"noise alone is {result.floor_um:.2f} µm.",
        f"- **Commands**: {', '.join(f'`compd {shlex.join(command)}`' for command in commands)}",
        "",
    ]
    return lines


def _hidden(result: Result) -> str:
    """The causes in the answer file, with their strengths and sizes."""
    answer = result.answer
    library = load_library()
    sentences = []
    for name, strength in answer["effects"].items():
        what = library[name].physics if name in library else (CAUSES[name].__doc__ or "").partition("\n")[0]
        values = strength if isinstance(strength, list) else [strength]
        numbers = ", ".join(f"{value:.3g}" for value in values)
        unit = "" if answer["units"][name] == "1" else f" {answer['units'][name]}"
        size = f"Alone it causes an error of {answer['error_in_floors'][name]:.1f} times the noise."
        sentences.append(f"`{name}`, strength {numbers}{unit}: {what} {size}")
    return " ".join(sentences)


def _anchor(title: str) -> str:
    """The heading's anchor as MyST makes it."""
    return "".join(letter for letter in title.lower() if letter.isalnum() or letter in " -").replace(" ", "-")
