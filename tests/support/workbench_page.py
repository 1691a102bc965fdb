"""The workbench in a real browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from tests.support.live_page import page_process, until

# A recording is open, and its effects are ranked.
SHOWN = "window.bench?.summary && document.querySelectorAll('.effect').length > 5"


def page_without_machine(directory: Path, *options: str) -> AbstractContextManager[tuple[str, int]]:
    """A page for the recordings in `directory/recordings` and the model files in `directory`; no daemon runs."""
    return page_process(Path("/no/socket"), directory / "recordings", "--models", str(directory), *options)


@contextmanager
def workbench_tabs(
    chromium: Any, address: str, *, apart: bool = False, height: int = 768
) -> Iterator[Callable[..., Any]]:
    """Opens tabs of the workbench by model file and recording; the scripts of all of them must not have failed.

    apart : each in a browser of its own, with its own cookies.
    """
    contexts: list[Any] = []
    failures: list[str] = []

    def opened(model: str, recording: str = "monday-1") -> Any:
        if apart or not contexts:
            contexts.append(chromium.new_context(viewport={"width": 1366, "height": height}))
        tab = contexts[-1].new_page()
        tab.on("pageerror", lambda error: failures.append(str(error)))
        tab.goto(address)
        tab.goto(address.partition("?")[0] + "workbench")
        open_recording(tab, model, recording)
        return tab

    try:
        yield opened
        assert failures == []
    finally:
        for context in contexts:
            context.close()


def open_recording(tab: Any, model: str, recording: str = "monday-1") -> None:
    """Choose a recording and a model file, and wait until both are shown."""
    until(tab, f"[...document.getElementById('recording').options].some((option) => option.value === '{recording}')")
    tab.locator("#recording").select_option(recording)
    tab.locator("#model").fill(model)
    tab.locator("#open").click()
    until(tab, SHOWN)
