"""The MACHINE message: what a client needs to draw the machine and to know its limits, without the configuration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from compd.configuration import Configuration
from compd.live.machine import MachineWires, Wire
from compd.live.service.message_keys.machine import MachineKeys
from compd.operation_settings import LoopBasics


def machine_message(configuration: Configuration, wires: MachineWires) -> dict[str, Any]:
    """The message as plain data: the sections of the configuration as a person wrote them, and the wiring resolved."""
    return MachineKeys.message(
        machine=configuration.machine,
        config_hash=configuration.config_hash,
        geometry=_geometry(configuration),
        **_mechanism(configuration),
        limits=configuration.limits.model_dump(mode="json"),
        loop=configuration.loop.model_dump(mode="json", include=set(LoopBasics.model_fields)),
        wiring=_wiring(configuration, wires),
    )


def _geometry(configuration: Configuration) -> dict[str, Any]:
    """The section; of own kinematics its class, without the path, which no remote client needs."""
    geometry: dict[str, Any] = configuration.geometry.model_dump(mode="json", exclude={"sha256"})
    if (external := configuration.external) is not None and external.own_class is not None:
        geometry["kinematics"] = external.own_class[1]
    return geometry


def _mechanism(configuration: Configuration) -> dict[str, Any]:
    """Actuators, rods, hinges and what a target fixes, whichever keys the configuration has; none of own kinematics."""
    if configuration.external is not None:
        return {}
    described = configuration.geometry.mechanism
    parts = {
        name: [part.model_dump(mode="json") for part in getattr(described, name)]
        for name in ("actuators", "rods", "hinges")
    }
    return {"mechanism": {**parts, "target_fixes": list(described.target_fixes)}}


def _wiring(configuration: Configuration, wires: MachineWires) -> list[dict[str, Any]]:
    """Every wired channel, in the order of STATUS: scales, joints, frame, quantities."""
    wiring = configuration.wiring
    scales = sorted(wiring.scale, key=lambda entry: entry.link)
    places: list[Mapping[str, Any]] = [
        *({"kind": "scale", "link": entry.link} for entry in scales),
        *({"kind": "joint", "link": entry.link, "role": entry.role} for entry in wiring.joint),
        *({"kind": "frame", "distance": wire.meaning.removeprefix("frame ")} for wire in wires.frame.wires),
        *({"kind": "quantity", "name": name} for name in wires.quantity_names),
    ]
    return [{**place, **_wire(wire)} for place, wire in zip(places, wires.all_wires, strict=True)]


def _wire(wire: Wire) -> dict[str, Any]:
    return {"channel": wire.channel, "sign": wire.sign, "stale_after_s": wire.stale_after_s}
