"""What the workbench in the browser costs, by rows: `python -m tests.benchmarks.bench_workbench`.

Side by side in one run, for recordings of 600 to 100,000 rows: how long it takes until a recording is open and
its effects are ranked, what the script and the frame take when a slider moves, in each kind of picture, how long a dry
run takes, and the memory of the page's process.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.benchmarks.figures import quiet, show
from tests.benchmarks.limits import run_limited
from tests.support.live_page import CHROMIUM, browser, page_process, until
from tests.support.measured import gauges, hidden, record

ROWS = (600, 5_000, 30_000, 100_000)
PICTURES = ("3D", "map xy", "target", "time")
WITHIN_S = 300.0
_RANKED = "document.querySelectorAll('.effect').length > 5"
_MOVES = 60
# In the browser: the slider goes through its range; the script's time for each move, then the time to the next frame.
_SCRIPT_MS = f"""() => {{
  const slider = document.querySelector('#card input[type=range]');
  return Array.from({{ length: {_MOVES} }}, (_, k) => {{
    slider.value = k * 0.1;
    const begin = performance.now();
    slider.dispatchEvent(new Event('input'));
    return performance.now() - begin;
  }});
}}"""
_FRAME_MS = f"""async () => {{
  const slider = document.querySelector('#card input[type=range]');
  const times = [];
  for (let k = 0; k < {_MOVES}; k++) {{
    const begin = performance.now();
    slider.value = k * 0.1;
    slider.dispatchEvent(new Event('input'));
    await new Promise((done) => requestAnimationFrame(done));
    times.push(performance.now() - begin);
  }}
  return times;
}}"""

# Each picture drawn in turn, so that other work of the computer falls on all alike.
_DRAWN_MS = f"""(kinds) => {{
  const times = kinds.map(() => []);
  for (let k = 0; k < {_MOVES}; k++) kinds.forEach((kind, place) => {{
    bench.picture.kind = kind;
    const begin = performance.now();
    bench.picture.draw();
    times[place].push(performance.now() - begin);
  }});
  return times;
}}"""


def peak_memory_mb(pid: int) -> float:
    """Largest resident memory of a process so far, MB."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM")).split()[1]) / 1024


def _timed_s(act: Any) -> float:
    begin_s = time.monotonic()
    act()
    return time.monotonic() - begin_s


def _quantiles(times_ms: list[float]) -> str:
    """Median and the longest but one in twenty."""
    times_ms = sorted(times_ms)
    return f"{times_ms[len(times_ms) // 2]:.1f} / {times_ms[round(0.95 * len(times_ms)) - 1]:.1f}"


def measured(rows: int) -> list[str]:
    """The figures of one recording."""
    effects = [hidden("link_expansion", 4.0), hidden("link_elasticity", 60.0)]
    with TemporaryDirectory() as name:
        recordings = Path(name) / "recordings"
        recordings.mkdir()
        record(recordings, gauges(rows, 1), effects, name="long-1")
        with (
            page_process(Path("/no/socket"), recordings, "--models", name) as (address, pid),
            browser() as chromium,
        ):
            tab = chromium.new_context(viewport={"width": 1440, "height": 1000}).new_page()
            tab.goto(address)
            workbench = address.partition("?")[0] + "workbench?recording=long-1&model=long.model.yaml"

            def open_it() -> None:
                tab.goto(workbench)
                until(tab, "window.bench?.summary", WITHIN_S)

            figures = [f"{_timed_s(open_it):.1f} s", f"{_timed_s(lambda: until(tab, _RANKED, WITHIN_S)):.1f} s"]
            tab.locator(".effect").first.click()
            until(tab, "bench.trial", WITHIN_S)
            for picture in PICTURES:
                tab.locator("[role=tab]", has_text=picture).click()
                figures += [_quantiles(tab.evaluate(_SCRIPT_MS)), _quantiles(tab.evaluate(_FRAME_MS))]
            arrows, dots = (statistics.median(times_ms) for times_ms in tab.evaluate(_DRAWN_MS, ["map xy", "target"]))
            figures.append(f"{arrows:.1f} / {dots:.1f} ms, {arrows / dots:.2f}")
            tab.locator("#add").click()
            figures.append(f"{_timed_s(lambda: tab.wait_for_selector('#confirm', timeout=1e3 * WITHIN_S)):.1f} s")
            return [*figures, f"{peak_memory_mb(pid):.0f} MB"]


def main() -> None:
    """Measure and print."""
    if not CHROMIUM:
        sys.exit("Chromium is not installed: apt-get install chromium")
    quiet()
    columns = [measured(rows) for rows in ROWS]
    names = ["open", "effects ranked, after that"]
    for picture in PICTURES:
        names += [f"slider, {picture}: script, ms (median / 95 %)", f"slider, {picture}: to the next frame, ms"]
    names += [
        "arrows / dots of a picture, drawn in turn, and their ratio",
        "dry run of adding an effect",
        "largest memory of the page's process",
    ]
    show("the workbench by rows", ["", *(f"{rows:,} rows" for rows in ROWS)], list(zip(names, *columns, strict=True)))


if __name__ == "__main__":
    run_limited(main, ROWS=(600,), PICTURES=PICTURES[:1])
