"""Make the gallery: `python -m docs.gallery [--screenshots required]`."""

from __future__ import annotations

import argparse
import shutil
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from compd.report.page import SHARED_SCRIPT
from docs.gallery.cases import CASES
from docs.gallery.markdown import gallery_text
from docs.gallery.real_hexapod import NAME, SESSIONS, real_hexapod_text, run_real_hexapod
from docs.gallery.result import run_case
from docs.gallery.screenshot import find_browser, take_screenshot

HERE = Path(__file__).parent
TEXT = HERE / "cases.md"
# Sphinx copies what is in _build/gallery beside its own pages.
PAGES = HERE.parent / "_build" / "gallery" / "gallery"
PICTURES = HERE.parent / "_build" / "gallery-pictures"


def main() -> None:
    """Measure, diagnose, draw, and photograph every case."""
    parser = argparse.ArgumentParser(prog="python -m docs.gallery", description=__doc__)
    parser.add_argument(
        "--screenshots",
        choices=("where-possible", "required"),
        default="where-possible",
        help="whether it is an error that there is no Chromium",
    )
    options = parser.parse_args()
    browser = find_browser()
    if browser is None:
        if options.screenshots == "required":
            sys.exit("the gallery needs Chromium for its screenshots; on Debian: apt-get install chromium")
        print("no Chromium here: the gallery's page has links and no screenshots")
    shutil.rmtree(PAGES, ignore_errors=True)
    PAGES.mkdir(parents=True)
    PICTURES.mkdir(exist_ok=True)
    with ProcessPoolExecutor(2) as pool:
        results = list(pool.map(partial(run_case, directory=PAGES), CASES))
    real = run_real_hexapod(PAGES)
    if real is None:
        print(f"gallery: the real hexapod is left out, there are no recordings in {SESSIONS}")
    if browser is not None:
        if real is not None:
            take_screenshot(browser, PAGES / f"{NAME}-calibration.html", PICTURES / f"{NAME}.png")
        for case in CASES:
            take_screenshot(browser, PAGES / f"{case.name}-diagnosis.html", PICTURES / f"{case.name}.png")
    pictures = "../_build/gallery-pictures" if browser else ""
    TEXT.write_text(f"{gallery_text(results, pictures)}\n{real_hexapod_text(real, pictures)}", encoding="utf-8")
    size_mb = sum(path.stat().st_size for path in PAGES.iterdir()) / 1e6
    script_mb = (PAGES / SHARED_SCRIPT).stat().st_size / 1e6
    print(f"gallery: {len(results)} cases, {size_mb:.1f} MB, of which {script_mb:.1f} MB are plotly's script")


if __name__ == "__main__":
    main()
