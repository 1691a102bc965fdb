"""A person who knows nothing of the page but the words on it: everything is found by visible text and by roles."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

from tests.support.patience import PATIENCE_S


class Offered(NamedTuple):
    """What adding an effect was said to do. effect : its name in words. warning : "" for none."""

    effect: str
    warning: str


class NaiveUser:
    """Uses the page in a tab; of effects always takes the one on top of the list."""

    def __init__(self, tab: Any) -> None:
        self.tab = tab
        tab.set_default_timeout(1e3 * PATIENCE_S)

    def press(self, name: str) -> None:
        """Press the button whose words begin so."""
        self.tab.get_by_role("button", name=re.compile(f"^{re.escape(name)}")).first.click()

    def follow(self, name: str) -> None:
        """Follow a link."""
        self.tab.get_by_role("link", name=name).first.click()

    def write(self, field: str, text: str) -> None:
        """Write into the field of that name, and leave it."""
        text_field, number_field = (self.tab.get_by_role(r, name=field, exact=True) for r in ("textbox", "spinbutton"))
        text_field.or_(number_field).fill(text)
        self.tab.keyboard.press("Tab")

    def bring(self, field: str, file: Path) -> None:
        """Give a file of this computer to the field of that name."""
        self.tab.get_by_label(field).last.set_input_files(file)

    def open(self, recording: str, model: str) -> None:
        """Choose a recording, name a model, and wait for the effects."""
        self.tab.get_by_label("Recording", exact=True).select_option(recording)
        self.tab.get_by_label("Model file, new or old").fill(model)
        self.press("Open")
        self.wait_for_effects()

    def wait_for_effects(self) -> None:
        """Until the list of effects is there."""
        self.tab.get_by_role("option", selected=False).nth(5).wait_for()

    def see(self, text: str | re.Pattern[str]) -> None:
        """Wait until this can be read."""
        self.tab.get_by_text(text).filter(visible=True).first.wait_for()

    def error_um(self) -> float:
        """The model's error, as the bar on top is described to who does not see it."""
        described = self.tab.get_by_role("img", name=re.compile("^The error as a bar")).get_attribute("aria-label")
        return float(re.search(r"([\d.]+) now", described)[1])  # type: ignore[index]

    def propose_top(self) -> Offered:
        """Choose the effect on top, fit it, ask to add it, and read what is said."""
        return self.take_effect()

    def take_effect(self, words: str = "") -> Offered:
        """The same with the first effect whose line has these words."""
        effects = self.tab.get_by_role("listbox", name=re.compile("^Effects"))
        effects.get_by_role("option").filter(has_text=words).first.click()
        chosen = effects.get_by_role("option", selected=True)
        name = str(chosen.inner_text()).splitlines()[0]
        self.press("Fit")
        self.press("Add …")
        self.tab.get_by_role("button", name=re.compile("^Add it to the model")).wait_for()
        warnings = self.tab.get_by_role("alert").filter(visible=True)
        return Offered(name, str(warnings.first.inner_text()) if warnings.count() else "")

    def confirm(self) -> None:
        """Add what is proposed, and wait until the model has it."""
        steps = self.tab.get_by_role("cell", name="add", exact=True).count()
        self.press("Add it to the model")
        self.tab.get_by_role("cell", name="add", exact=True).nth(steps).wait_for()
        self.wait_for_effects()
