"""Pictures of pages, by a headless Chromium."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# The first screen of a page: its verdict and its first figures.
WIDTH_PX, HEIGHT_PX = 1120, 960
# The page's own clock, which runs as fast as the machine can: plotly has drawn when it is over.
VIRTUAL_TIME_MS = 5000
TIMEOUT_S = 60.0


def find_browser() -> str | None:
    """The path of a Chromium, or None."""
    return next((path for path in map(shutil.which, BROWSERS) if path), None)


def take_screenshot(browser: str, page: Path, picture: Path) -> None:
    """Write the first screen of `page` to the PNG file `picture`. Raises RuntimeError where there is none after it."""
    picture.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="compd-browser-") as profile:
        done = subprocess.run(
            [
                browser,
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                # a container's /dev/shm is small
                "--disable-dev-shm-usage",
                "--hide-scrollbars",
                f"--user-data-dir={profile}",
                f"--window-size={WIDTH_PX},{HEIGHT_PX}",
                f"--virtual-time-budget={VIRTUAL_TIME_MS}",
                f"--screenshot={picture.resolve()}",
                page.resolve().as_uri(),
            ],
            timeout=TIMEOUT_S,
            capture_output=True,
            text=True,
            check=False,
        )
    if not picture.is_file():
        raise RuntimeError(f"{browser} has made no picture of {page}:\n{done.stderr}")
