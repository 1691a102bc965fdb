"""Orders that a person may give from the page: their consequence in numbers, and their execution.

An order is shown first: its consequence for this machine now, and the command line that does the same. It is done for
a browser that is armed.
"""

from __future__ import annotations

import asyncio
import os
import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compd.client import Client, connect
from compd.errors import DaemonError, Problem
from compd.gauge import Quality
from compd.page.daemon_link import DaemonLink
from compd.page.model_files import ModelFiles, hash_of_file, opened
from compd.units import UM_PER_MM

# Timeout (s) of an order; reading a model file takes a second, and an effect of one's own may import any library.
_TIMEOUT_S = 30.0
# Length of a model's hash in the daemon's messages.
_HASH = re.compile("[0-9a-f]{16}")
_NO_HASH = "the model that runs as a shadow is adopted, and named by its hash"
_NOT_OFFERED = "this is not a model file in the list"
_NAME_IT = "choose one of them; another one is given on the command line"


@dataclass(frozen=True)
class Consequence:
    """Consequence of an order. possible : whether it can be given now. text : in words and numbers. command : the same
    as a command line. subject : of the order that does exactly this; "" is that which was asked for."""

    possible: bool
    text: str
    command: str
    subject: str = ""


class Orders:
    """The orders by name, each with its consequence and its execution."""

    def __init__(self, link: DaemonLink, files: ModelFiles | None = None) -> None:
        self._link = link
        self._files = files or ModelFiles(None)
        self._consequences: Mapping[str, Callable[[str], Consequence]] = {
            "zero": self._zero,
            "accept": self._accept,
            "shadow": self._shadow,
            "adopt": self._adopt,
            "no-model": self._no_model,
        }
        self._calls: Mapping[str, Callable[[Client, str], Mapping[str, Any]]] = {
            "zero": lambda client, subject: client.zero(replace=subject == "replace"),
            "accept": self._accept_gauges,
            "shadow": self._run_shadow,
            "adopt": lambda client, subject: client.adopt_shadow(subject),
            "no-model": lambda client, subject: client.model(""),
        }

    def __contains__(self, name: str) -> bool:
        return name in self._calls

    def consequence(self, name: str, subject: str) -> Consequence:
        """Consequence of the order `name` for a gauge (`accept`) or a listed model file (`shadow`, `adopt`)."""
        if not self._link.connected:
            return Consequence(False, f"The daemon is not there: {self._link.reason}.", "")
        return self._consequences[name](subject)

    async def do(self, name: str, subject: str, by: str) -> Mapping[str, Any]:
        """Give the order to the daemon; return its answer.


        subject : of `adopt` the hash of the shadow, as its consequence says it. by : for whom, for the daemon's log.
        Raises DaemonError, also for a model file that is not offered; the daemon is not asked then.
        """
        if name == "shadow" and subject:
            self._path(subject)
        if name == "adopt" and not _HASH.fullmatch(subject):
            raise DaemonError.of("page", _NO_HASH, value=subject)
        return await asyncio.to_thread(self._ask, name, subject, by)

    def _ask(self, name: str, subject: str, by: str) -> Mapping[str, Any]:
        with connect(self._link.path, _TIMEOUT_S, by=by) as client:
            return self._calls[name](client, subject)

    def _accept_gauges(self, client: Client, subject: str) -> Mapping[str, Any]:
        """Raises DaemonError for gauges that stay distrusted: the order is not done."""
        answer = client.accept(subject)
        if refused := answer.get("not_believed"):
            raise DaemonError(
                [Problem(channel, f"still not believed: {reason}") for channel, reason in refused.items()]
            )
        return answer

    def _run_shadow(self, client: Client, subject: str) -> Mapping[str, Any]:
        if not subject:
            return client.model("", shadow=True)
        path = self._path(subject)
        try:
            descriptor = opened(path)
        except OSError as error:
            raise DaemonError.of(str(path), f"cannot be read: {error.strerror or error}") from error
        try:
            return client.model(path, shadow=True, descriptor=descriptor)
        finally:
            os.close(descriptor)

    def _path(self, subject: str) -> Path:
        """Path of an offered model file. Raises DaemonError for any other name."""
        if (path := self._files.path_of(subject)) is None:
            raise DaemonError.of("page", _NOT_OFFERED, value=subject, next_step=_NAME_IT)
        return path

    def _command(self, *words: str) -> str:
        return shlex.join(["compd", *words])

    def _zero(self, subject: str) -> Consequence:
        status, machine = self._link.status, self._link.machine
        command = self._command("zero", "--daemon", self._link.path, *(["--yes"] if subject == "replace" else []))
        if status is None or machine is None:
            return Consequence(False, "The daemon has not told its status yet.", command)
        gauges = sum(wire["kind"] != "quantity" for wire in machine["wiring"])
        text = f"{gauges} gauges are averaged for one second; the machine must stand still at its zero position."
        if status["zero"]["taken"]:
            text += f" The zero of {status['zero']['taken_at']} is kept as machine-zero.json.old."
        if largest := self._largest_um():
            text += f" The correction, now up to {largest:.1f} µm, begins at zero again."
        return Consequence(True, text, command)

    def _accept(self, subject: str) -> Consequence:
        status = self._link.status or {"gauges": []}
        waiting = [gauge for gauge in status["gauges"] if gauge["quality"] == Quality.DISTRUSTED]
        chosen = [g for g in waiting if subject in ("all", g["channel"], g["channel"].partition(".")[0])]
        command = self._command("accept", subject, "--daemon", self._link.path)
        if not chosen:
            return Consequence(False, "Every gauge is believed." if not waiting else "This gauge is believed.", command)
        lines = [f"{gauge.get('measures', gauge['channel'])}: {gauge.get('detail', '')}" for gauge in chosen]
        text = f"{status['waits_for_person']}. What it shows from now on is taken as it is: reference it first. "
        return Consequence(True, text[0].upper() + text[1:] + "; ".join(lines), command)

    def _shadow(self, subject: str) -> Consequence:
        if not subject:
            command = self._command("model", "shadow", "--none", "--daemon", self._link.path)
            return Consequence(True, "No model runs beside the applied one any more.", command)
        path = self._files.path_of(subject)
        command = self._command("model", "shadow", "FILE" if path is None else str(path), "--daemon", self._link.path)
        if path is None:
            return Consequence(False, f"{_NOT_OFFERED}: {_NAME_IT}.", command)
        text = "The daemon tries the file. It is computed beside the applied model; nothing of it reaches the machine."
        return Consequence(True, text, command)

    def _adopt(self, subject: str) -> Consequence:
        """Consequence of adopting the shadow model. subject : its file's name, its hash, or ""."""
        running = (self._link.models or {}).get("shadow", {})
        file, hash_ = str(running.get("file", "")), str(running.get("model", ""))
        command = self._command("model", "adopt", file or "FILE", "--daemon", self._link.path)
        if why := self._is_another(subject, file, hash_):
            return Consequence(False, why, command)
        setpoint = (self._link.readings or {}).get("setpoint", {})
        shadow = setpoint.get("shadow", {})
        if "correction_mm" not in shadow or "sources_mm" not in setpoint or "tip_correction_mm" in setpoint:
            of_tip = "the tip of this machine is corrected" if "tip_correction_mm" in setpoint else ""
            why = shadow.get("reason") or of_tip or "there is no valid setpoint to compare it with"
            return Consequence(False, f"What it would change is not known: {why}.", command)
        asked_mm = [sum(parts) for parts in zip(*setpoint["sources_mm"].values(), strict=True)]
        text = f"{file} ({hash_}): {self._change(asked_mm, shadow['correction_mm'])}"
        return Consequence(True, text, command, hash_)

    def _is_another(self, subject: str, file: str, hash_: str) -> str:
        """Reason why `subject` is not the shadow model, called `file`, with this hash; "" if it is.

        Only of the shadow it has been seen what it does.
        """
        if not hash_:
            return "No model runs as a shadow: let one run first, so that its effect is known."
        if subject in ("", hash_):
            return ""
        if _HASH.fullmatch(subject):
            return f"Another model runs as a shadow ({hash_}): let this one run first."
        if (path := self._files.path_of(subject)) is None:
            return f"{_NOT_OFFERED}: {_NAME_IT}."
        try:
            same = hash_of_file(path) == hash_
        except OSError as error:
            return f"{path} cannot be read: {error.strerror or error}."
        return "" if same else f"{file} runs as a shadow, not {path} as it is now: let it run first."

    def _no_model(self, subject: str) -> Consequence:
        command = self._command("model", "adopt", "--none", "--daemon", self._link.path)
        contributions = (self._link.readings or {}).get("setpoint", {}).get("sources_mm")
        if contributions is None:
            return Consequence(
                True,
                "The machine is computed without effects; by how much the correction changes is not known, "
                "because there is no valid setpoint.",
                command,
            )
        asked_mm = [sum(parts) for parts in zip(*contributions.values(), strict=True)]
        bare_mm = [sum(parts) for parts in zip(contributions["joints"], contributions["frame"], strict=True)]
        of_tip = "tip_correction_mm" in (self._link.readings or {}).get("setpoint", {})
        return Consequence(True, self._change(asked_mm, bare_mm, "xyz" if of_tip else ""), command)

    def _change(self, before_mm: list[float], after_mm: list[float], axes: str = "") -> str:
        """axes : names of the numbers where they are the tip's; "" for links."""
        changes_um = [UM_PER_MM * (after - before) for before, after in zip(before_mm, after_mm, strict=True)]
        link = max(range(len(changes_um)), key=lambda k: abs(changes_um[k]))
        limits = (self._link.machine or {}).get("limits", {})
        where = f"along {axes[link]}" if axes else f"at link {link + 1}"
        text = f"The correction changes by {changes_um[link]:+.1f} µm {where}, and by less at the others."
        if slew := limits.get("slew_mm_per_s"):
            text += f" It slews for {abs(changes_um[link]) / UM_PER_MM / slew:.1f} s."
        return text

    def _largest_um(self) -> float:
        setpoint = (self._link.readings or {}).get("setpoint", {})
        return max((abs(value) * UM_PER_MM for value in setpoint.get("correction_mm", ())), default=0.0)


def explained(error: DaemonError) -> str:
    """A refusal of the daemon in one line, for the page."""
    problem = error.problems[0]
    return "; ".join(filter(None, (problem.what, problem.next_step)))
