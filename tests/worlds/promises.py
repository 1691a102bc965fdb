"""What the daemon has promised, and how long that binds it: the model that it has adopted, the machine zero taken."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from compd.live.loop import Setpoint
from compd.live.machine import MachineZero
from compd.live.machine.machine_zero import FILE_NAME
from tests.worlds.invariants import adopted_model, nothing_lost
from tests.worlds.world import World

# A daemon that another one follows publishes its last setpoint within this time, s.
_FOLLOWED_WITHIN_S = 5.0
_HASH_DIGITS = 16
ROLES = ("applied", "shadow")


class Promises:
    """Follows the orders for models and machine zeros of one world, and what was answered.

    Attributes
    ----------
    models : by role, the hashes that a setpoint may name now; "" for no model. Several while an order is open.
    """

    def __init__(self, world: World) -> None:
        self.models = {role: {""} for role in ROLES}
        self._hub = world.hub
        self._promised = dict.fromkeys(ROLES, "")
        self._open: dict[int, Mapping[str, str]] = {}
        self._starts = 0
        self._world = world
        self._zero: Mapping[str, float] | None = dict(world.zero.readings_mm)
        self._zeros_open: set[int] = set()
        world.clients.asks.append(self.asks)
        world.clients.replies.append(self.replies)
        world.beginners.append(self.begins)

    def asks(self, number: int, request: Mapping[str, Any], file: Path | None) -> None:
        """A person sends a request."""
        if request["class"] == "ZERO":
            self._zeros_open.add(number)
        if request["class"] != "MODEL" or not {"file", "hash"} & request.keys():
            return
        model = request.get("hash", "")
        if file is not None:
            model = hashlib.sha256(file.read_bytes()).hexdigest()[:_HASH_DIGITS]
        self._open[number] = {"shadow": model} if request.get("shadow") else {"applied": model, "shadow": ""}
        self._narrow(keep=True)

    def replies(self, number: int, message: Mapping[str, Any] | None) -> None:
        """A person gets the answer to a request; None where nobody has answered in time."""
        if number in self._zeros_open:
            self._zeros_open.remove(number)
            is_taken = message is not None and message["class"] == "ZERO"
            self._zero = message["readings_mm"] if is_taken and message is not None else None
        if number not in self._open or message is None:
            return  # without an answer nobody knows: the order stays open until the daemon has ended
        del self._open[number]
        if message["class"] == "MODEL":
            self._promised = {role: message.get(role, {}).get("model", "") for role in ROLES}
        self._narrow()

    def begins(self) -> None:
        """A daemon begins: it starts with the model of its configuration, which is none in a world."""
        self._starts += 1
        starts = self._starts

        def has_followed() -> None:
            if starts == self._starts:
                self._narrow()

        self._promised = dict.fromkeys(ROLES, "")
        self._narrow(keep=True)
        self._hub.at(self._hub.now_s + _FOLLOWED_WITHIN_S, has_followed)

    def zero_lost(self) -> str:
        """What is wrong with the machine zero that is used; "" for nothing.

        While one is being taken it may be the old one, the new one or none. Where that was refused, or nobody has
        answered, the one that is used from then on stays.
        """
        assert self._world.daemon is not None
        zero = self._world.daemon.commands.zero
        used = zero.readings_mm if isinstance(zero, MachineZero) else {}
        if self._zeros_open:
            return ""
        if self._zero is None:
            self._zero = used
        taken, self._zero = self._zero, used
        if not used and FILE_NAME in self._world.system.disk.torn:
            return ""  # it is said that there is none
        return nothing_lost(taken, used)

    def broken(self, setpoint: Setpoint) -> str:
        """What a setpoint breaks; "" for nothing."""
        shadow = setpoint.shadow.model if setpoint.shadow is not None else ""
        shadows = self.models["shadow"] if shadow else {""}  # an invalid setpoint has no shadow's result
        return adopted_model(self.models["applied"], setpoint.model) or adopted_model(shadows, shadow)

    def _narrow(self, keep: bool = False) -> None:
        """Only what was promised last, and what was asked for since. keep : and what may be used until now."""
        for role in ROLES:
            before = self.models[role] if keep else set()
            asked = {wish[role] for wish in self._open.values() if role in wish}
            self.models[role] = {self._promised[role], *asked, *before}
