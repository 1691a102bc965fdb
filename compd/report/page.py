"""A page that works offline: a verdict in words, then tables, then pictures. One file, no network."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from plotly.graph_objects import Figure
from plotly.offline import get_plotlyjs

# Colours that stay apart for colour-blind readers (Okabe and Ito, 2008), in a fixed order of meaning.
COLOURS = {"worst": "#d55e00", "middle": "#e69f00", "best": "#009e73", "plain": "#0072b2", "quiet": "#8a8f98"}

_STYLE = """
:root { color-scheme: light; }
body { font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; margin: 0; color: #1c2126; background: #fff; }
main { max-width: 1080px; margin: 0 auto; padding: 2rem 1.5rem 4rem; }
h1 { font-size: 1.7rem; margin: 0 0 .3rem; } h2 { font-size: 1.15rem; margin: 2.4rem 0 .4rem; }
.verdict { font-size: 1.15rem; margin: .4rem 0 1.4rem; max-width: 60rem; }
table { border-collapse: collapse; margin: .8rem 0 1.2rem; } caption { text-align: left; color: #555c64; }
th, td { padding: .35rem .9rem .35rem 0; border-bottom: 1px solid #dfe3e8; text-align: left; }
th.number, td.number { text-align: right; font-variant-numeric: tabular-nums; }
thead th { border-bottom: 2px solid #9aa2ab; }
p.caption { color: #555c64; margin: 0 0 .3rem; max-width: 60rem; }
footer { margin-top: 3rem; color: #555c64; font-size: .9rem; }
"""


@dataclass(frozen=True)
class PageTable:
    """Rows of text under a head; the first column is what the row is about."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Panel:
    """A heading, one sentence that says how to read it, and a picture or a table."""

    title: str
    caption: str
    content: Figure | PageTable


def write_page(path: Path, title: str, verdict: str, panels: Sequence[Panel], footer: str) -> None:
    """Write the page whole: plotly's script is inside it, once."""
    parts = [
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title>",
        f"<style>{_STYLE}</style><script>{get_plotlyjs()}</script><main><h1>{html.escape(title)}</h1>",
        f"<p class=verdict>{html.escape(verdict)}</p>",
    ]
    for number, panel in enumerate(panels):
        parts.append(f"<h2>{html.escape(panel.title)}</h2><p class=caption>{html.escape(panel.caption)}</p>")
        parts.append(_table(panel.content) if isinstance(panel.content, PageTable) else _figure(panel.content, number))
    parts.append(f"<footer>{html.escape(footer)}</footer></main></html>")
    path.write_text("\n".join(parts), encoding="utf-8")


def styled(figure: Figure, x: str, y: str, height_px: int = 340) -> Figure:
    """The one look of every picture: axis titles with units, quiet grid, legend on top."""
    figure.update_layout(
        template="plotly_white",
        height=height_px,
        margin={"l": 70, "r": 20, "t": 30, "b": 50},
        font={"family": "system-ui, DejaVu Sans, sans-serif", "size": 13},
        legend={"orientation": "h", "y": 1.02, "yanchor": "bottom", "x": 0},
        xaxis_title=x,
        yaxis_title=y,
    )
    return figure


def _figure(figure: Figure, number: int) -> str:
    text: Any = figure.to_html(
        full_html=False,
        include_plotlyjs=False,
        div_id=f"figure-{number}",
        config={"displaylogo": False, "responsive": True},
    )
    return str(text)


def _table(table: PageTable) -> str:
    """Columns of numbers are aligned on the right."""
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(table.head)
    kinds = [" class=number" if all(map(_is_number, column)) else "" for column in columns]

    def row(name: str, cells: Sequence[str]) -> str:
        found = (f"<{name}{kind}>{html.escape(cell)}</{name}>" for kind, cell in zip(kinds, cells, strict=True))
        return f"<tr>{''.join(found)}</tr>"

    caption = f"<caption>{html.escape(table.caption)}</caption>" if table.caption else ""
    body = "".join(row("td", cells) for cells in table.rows)
    return f"<table>{caption}<thead>{row('th', table.head)}</thead><tbody>{body}</tbody></table>"


def _is_number(cell: str) -> bool:
    """With or without a unit behind it; or nothing known."""
    return cell in ("", "-") or cell[0].isdigit() or (cell[0] in "+-." and cell[1:2].isdigit())
