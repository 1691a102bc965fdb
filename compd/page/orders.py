"""What a person may order from the page: what each order will do, in numbers, and doing it.

An order is shown first: its consequence for this machine now, and the command line that does the same. It is done for
a browser that is armed.
"""

from __future__ import annotations

import asyncio
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from compd.client import Client, connect
from compd.errors import DaemonError, Problem
from compd.gauge import Quality
from compd.page.daemon_link import DaemonLink
from compd.page.model_files import ModelFiles
from compd.units import UM_PER_MM

# Reading a model file takes a second; an effect of a person's own may import what it likes.
_TIMEOUT_S = 30.0
_NOT_OFFERED = "this is none of the model files in the list"
_NAME_IT = "choose one of them, or give the absolute path of another"


@dataclass(frozen=True)
class Consequence:
    """What an order will do. possible : whether it can be given now. text : in words and numbers. command : the same
    as a command line. subject : of the order that does exactly this; "" is that which was asked for."""

    possible: bool
    text: str
    command: str
    subject: str = ""


class Orders:
    """The orders by name: each has a consequence, and is done."""

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
            "accept": lambda client, subject: client.accept(subject),
            "shadow": lambda client, subject: client.model(subject, shadow=True),
            "adopt": lambda client, subject: client.model(_shadowed(client.model(), subject)),
            "no-model": lambda client, subject: client.model(""),
        }

    def __contains__(self, name: str) -> bool:
        return name in self._calls

    def consequence(self, name: str, subject: str) -> Consequence:
        """Of the order `name` for a gauge (`accept`) or a model file (`shadow`, `adopt`)."""
        if not self._link.connected:
            return Consequence(False, f"The daemon is not there: {self._link.reason}.", "")
        return self._consequences[name](subject)

    async def do(self, name: str, subject: str, by: str) -> Mapping[str, Any]:
        """Give the order to the daemon; its answer. by : who gives it, in one line.

        Raises DaemonError, also for a model file that is not offered.
        """
        if name == "adopt" or (name == "shadow" and subject):
            subject = self._file(subject)
        return await asyncio.to_thread(self._ask, name, subject)

    def _ask(self, name: str, subject: str) -> Mapping[str, Any]:
        with connect(self._link.path, _TIMEOUT_S) as client:
            return self._calls[name](client, subject)

    def _command(self, *words: str) -> str:
        return shlex.join(["compd", *words])

    def _zero(self, subject: str) -> Consequence:
        status, machine = self._link.status, self._link.machine
        command = self._command("zero", self._link.path, *(["--yes"] if subject == "replace" else []))
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
        text = "What it shows from now on is taken as it is. Look at the gauge, and reference it, first. "
        return Consequence(True, text + "; ".join(lines), command)

    def _file(self, subject: str) -> str:
        """The path of a model file that a browser names. Raises DaemonError where it is none that may be named."""
        path = self._files.path_of(subject, self._link.models)
        if path is None:
            raise DaemonError(Problem(where="page", what=_NOT_OFFERED, value=subject, next_step=_NAME_IT))
        return path

    def _shadow(self, subject: str) -> Consequence:
        if not subject:
            command = self._command("shadow", "--none", "--daemon", self._link.path)
            return Consequence(True, "No model runs beside the applied one any more.", command)
        path = self._files.path_of(subject, self._link.models)
        command = self._command("shadow", path or subject, "--daemon", self._link.path)
        if path is None:
            return Consequence(False, f"{_NOT_OFFERED}: {_NAME_IT}.", command)
        text = "The daemon reads and tries the file. It is computed beside the applied model; nothing of it reaches "
        return Consequence(True, text + "the machine.", command, path)

    def _adopt(self, subject: str) -> Consequence:
        """Of the model that runs as a shadow: its correction is known."""
        shadow_file = str((self._link.models or {}).get("shadow", {}).get("file", ""))
        path = self._files.path_of(subject, self._link.models) if subject else shadow_file
        command = self._command("adopt", path or subject or "FILE", "--daemon", self._link.path)
        if path is None:
            return Consequence(False, f"{_NOT_OFFERED}: {_NAME_IT}.", command)
        try:
            _shadowed(self._link.models or {}, path)
        except DaemonError as error:
            return Consequence(False, f"{explained(error)}.", command)
        setpoint = (self._link.readings or {}).get("setpoint", {})
        shadow = setpoint.get("shadow", {})
        if "correction_mm" not in shadow or "sources_mm" not in setpoint:
            why = shadow.get("reason") or "there is no valid setpoint to compare it with"
            return Consequence(False, f"What it would change is not known: {why}.", command)
        asked_mm = [sum(parts) for parts in zip(*setpoint["sources_mm"].values(), strict=True)]
        text = f"{path}: {self._change(asked_mm, shadow['correction_mm'])}"
        return Consequence(True, text, command, path)

    def _no_model(self, subject: str) -> Consequence:
        command = self._command("adopt", "--none", "--daemon", self._link.path)
        sources = (self._link.readings or {}).get("setpoint", {}).get("sources_mm")
        if sources is None:
            return Consequence(
                True,
                "The machine is computed without effects; by how much the correction changes is not known, "
                "because there is no valid setpoint.",
                command,
            )
        asked_mm = [sum(parts) for parts in zip(*sources.values(), strict=True)]
        bare_mm = [sum(parts) for parts in zip(sources["joints"], sources["frame"], strict=True)]
        return Consequence(True, self._change(asked_mm, bare_mm), command)

    def _change(self, before_mm: list[float], after_mm: list[float]) -> str:
        changes_um = [UM_PER_MM * (after - before) for before, after in zip(before_mm, after_mm, strict=True)]
        link = max(range(len(changes_um)), key=lambda k: abs(changes_um[k]))
        limits = (self._link.machine or {}).get("limits", {})
        text = f"The correction changes by {changes_um[link]:+.1f} µm at link {link + 1}, and by less at the others."
        if slew := limits.get("slew_mm_per_s"):
            text += f" It slews for {abs(changes_um[link]) / UM_PER_MM / slew:.1f} s."
        return text

    def _largest_um(self) -> float:
        setpoint = (self._link.readings or {}).get("setpoint", {})
        return max((abs(value) * UM_PER_MM for value in setpoint.get("correction_mm", ())), default=0.0)


def _shadowed(models: Mapping[str, Any], file: str) -> str:
    """`file`, where it is the shadow's among the models of a MODEL message: only the shadow's effect has been seen.

    Raises DaemonError where it is another's.
    """
    running = str(models.get("shadow", {}).get("file", ""))
    if not running or file != running:
        raise DaemonError(
            Problem(
                where="adopt",
                what=f"{running} runs as a shadow, not {file}" if running else "no model runs as a shadow",
                next_step="let the model run as a shadow first, so that its effect is known",
            )
        )
    return file


def explained(error: DaemonError) -> str:
    """A refusal of the daemon in one line, for the page."""
    problem = error.problems[0]
    return "; ".join(filter(None, (problem.what, problem.next_step)))
