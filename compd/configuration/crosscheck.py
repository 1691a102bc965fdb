"""Checks across sections: the wiring against the gauges, the votes against the wiring, and those of `line_checks`."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

from compd.configuration.line_checks import line_problems
from compd.configuration.line_slips import line_slips
from compd.configuration.sections import Sections
from compd.documents import Location
from compd.errors import Problem
from compd.gauge import Gauge, GaugeOptions
from compd.operation_settings import FRAME_DISTANCES, WIRES, measured_distances

# Packages whose drivers are covered by compd's own tests.
_OWN_PACKAGES = ("compd", "compd_drivers")


def problems(sections: Sections) -> list[Problem]:
    """Every contradiction between sections, as far as they could be read."""
    return [
        *line_problems(sections),
        *_channel_problems(sections),
        *_completeness_problems(sections),
        *_vote_problems(sections),
    ]


def warnings(sections: Sections) -> list[Problem]:
    """Usable but suspicious settings.

    Lines without gauges, gauges without wires, and foreign drivers in the process of other lines.
    """
    gauges = sections.document.data.get("gauges")
    named = gauges.values() if isinstance(gauges, dict) else ()
    used_lines = {str(options.get("line")) for options in named if isinstance(options, dict)}
    unused = [
        Problem(
            sections.document.where(("lines", name)), "no gauge uses this line", next_step="remove it or wire a gauge"
        )
        for name in sections.lines
        if used_lines and name not in used_lines
    ]
    wired_gauges = {channel.split(".")[0] for _, channel, _ in _wires(sections.wiring)}
    whole = all(_is_whole(sections.wiring, kind, "gauge") for kind in WIRES)
    unused += [
        Problem(
            sections.document.where(("gauges", name)),
            "polled but wired to nothing",
            next_step="name it under `wiring:` or remove it",
        )
        for name in sections.gauges
        if whole and name not in wired_gauges
    ]
    return [
        *unused,
        *line_slips(sections),
        *_option_warnings(sections),
        *_vote_warnings(sections),
        *_shared_process_warnings(sections),
    ]


def resolve_channel(
    channel: str, gauges: Mapping[str, GaugeOptions], drivers: Mapping[str, type[Gauge[Any]]]
) -> str | None:
    """The full name "gauge.channel" of a channel; "gauge" alone is allowed for a gauge with one channel.

    None if there is no such channel, or if several fit.
    """
    gauge, _, channel_name = channel.partition(".")
    if gauge not in gauges:
        return None
    names = [channel.name for channel in drivers[gauge](gauges[gauge]).channels]
    if not channel_name:
        return f"{gauge}.{names[0]}" if len(names) == 1 else None
    return channel if channel_name in names else None


def _option_warnings(sections: Sections) -> Iterator[Problem]:
    """A driver's doubts about its gauge's options."""
    for name, options in sections.gauges.items():
        for location, what, value, next_step in sections.drivers[name](options).doubts():
            where = sections.document.where(("gauges", name, *location))
            yield Problem(where, what, value=value, next_step=next_step)


def _vote_problems(sections: Sections) -> Iterator[Problem]:
    """A vote on a quantity that is not wired."""
    temperature = getattr(getattr(sections.votes, "frame", None), "temperature", None)
    names = [wire.name for _, wire in _entries(sections.wiring, "quantities")]
    if temperature is not None and temperature not in names and None not in names:
        yield Problem(
            sections.document.where(("votes", "frame", "temperature")),
            "no such quantity",
            value=temperature,
            allowed=", ".join(names),
            next_step="write a name under `wiring: quantities:`",
        )


def _vote_warnings(sections: Sections) -> Iterator[Problem]:
    """A vote without any gauge that can give it."""
    roles = {(wire.link, wire.role) for _, wire in _entries(sections.wiring, "joint")}
    pairs = [link for link, role in roles if role == "Ra" and (link, "Rb") in roles]
    if getattr(sections.votes, "joint_pair_um", None) is not None and not pairs:
        yield Problem(
            sections.document.where(("votes", "joint_pair_um")),
            "no joint has two comparators, Ra and Rb: this vote sees nothing",
            next_step="remove it",
        )


def _shared_process_warnings(sections: Sections) -> Iterator[Problem]:
    """A driver that is not part of compd, on a line that shares its process with others."""
    own_process = getattr(sections.acquisition, "own_process", None) or ()
    for name, options in sections.gauges.items():
        shared = set(sections.lines).difference(own_process)
        if options.line in shared and len(shared) > 1 and _from_elsewhere(options.driver, sections.drivers[name]):
            yield Problem(
                sections.document.where(("gauges", name, "driver")),
                "this driver is not part of compd and shares a process with other lines: if it keeps the "
                "interpreter or crashes, their readings are late or lost too",
                value=options.driver,
                next_step=f"write `{options.line}` under `acquisition: own_process:`",
            )


def _from_elsewhere(driver: str, kind: type[Gauge[Any]]) -> bool:
    """Whether a driver is a person's own file or from a foreign package. driver : its name in the file."""
    return driver.startswith("/") or kind.__module__.partition(".")[0] not in _OWN_PACKAGES


def _entries(wiring: Any, kind: str) -> list[tuple[int, Any]]:
    """The readable wires of a kind, each with its index in the list."""
    return [(i, wire) for i, wire in enumerate(getattr(wiring, kind, None) or ()) if wire is not None]


def _wires(wiring: Any) -> Iterator[tuple[Location, str, str]]:
    """Every wire: its location in the document, the channel that it names, the unit that it must have; "" for any."""
    for kind in WIRES:
        for i, wire in _entries(wiring, kind):
            if wire.gauge is not None:
                unit = "mm" if kind != "quantities" else (wire.name or "").rpartition("_")[2]
                yield ("wiring", kind, i, "gauge"), wire.gauge, unit


def _channel_problems(sections: Sections) -> Iterator[Problem]:
    """A wire whose channel does not exist, has another unit, or is wired already."""
    location_of_channel: dict[str, Location] = {}
    gauges_in_file = sections.document.data.get("gauges")
    if not isinstance(gauges_in_file, dict):
        return
    for location, channel, unit in _wires(sections.wiring):
        name = channel.split(".")[0]
        where = sections.document.where(location)
        if name not in sections.gauges:
            if name not in gauges_in_file:  # a faulty gauge is already reported
                yield Problem(
                    where,
                    "no such gauge",
                    value=channel,
                    allowed=", ".join(map(str, gauges_in_file)),
                    next_step="write a name under `gauges:`",
                )
            continue
        units = {channel.name: channel.unit for channel in sections.drivers[name](sections.gauges[name]).channels}
        full_name = resolve_channel(channel, sections.gauges, sections.drivers)
        if full_name is None:
            yield Problem(
                where,
                f"gauge `{name}` has no such single channel",
                value=channel,
                allowed=", ".join(f"{name}.{channel_name}" for channel_name in units),
                next_step="write gauge.channel",
            )
            continue
        delivers = units[full_name.split(".")[1]]
        if unit and delivers != unit:
            yield Problem(where, f"needs a gauge in {unit}, this one delivers {delivers}", value=channel)
        if full_name in location_of_channel:
            yield Problem(
                where,
                f"wired already at {sections.document.where(location_of_channel[full_name])}",
                value=channel,
                allowed="each channel once",
            )
        location_of_channel[full_name] = location


def _completeness_problems(sections: Sections) -> Iterator[Problem]:
    """Frame distances, quantities, scales and joint comparators that are wired too rarely or too often."""
    yield from _frame_problems(sections)
    yield from _quantity_problems(sections)
    if sections.scales is not None:
        yield from _scale_problems(sections, sections.scales)
    if sections.links is not None:
        yield from _joint_problems(sections, sections.links)


def _is_whole(wiring: Any, kind: str, key: str) -> bool:
    """Whether this key of all wires of a kind could be read; only then is an absent one missing."""
    wires = getattr(wiring, kind, None)
    return wires is not None and all(getattr(wire, key, None) is not None for wire in wires)


def _frame_problems(sections: Sections) -> Iterator[Problem]:
    counts = Counter(wire.distance for _, wire in _entries(sections.wiring, "frame"))
    if not counts:  # the frame is taken to stand still
        return
    if sections.framed is False:
        yield Problem(
            sections.document.where(("wiring", "frame")),
            "has frame comparators, but the geometry does not say where they stand",
            next_step="write `geometry: base: supports_B_mm` and `plate_points_M_mm`, or leave `frame` out",
        )
    whole = _is_whole(sections.wiring, "frame", "distance")
    needed = FRAME_DISTANCES if any(counts[t] for t in FRAME_DISTANCES[:3]) else measured_distances(6)
    for distance in FRAME_DISTANCES:
        least = 1 if whole and distance in needed else 0
        if not least <= counts[distance] <= 1:
            yield Problem(
                sections.document.where(("wiring", "frame")),
                f"frame distance {distance} is wired {counts[distance]} times",
                allowed="t1..t3 and u1..u6, each exactly once; u1..u6 alone; or none of them",
            )


def _quantity_problems(sections: Sections) -> Iterator[Problem]:
    names = Counter(wire.name for _, wire in _entries(sections.wiring, "quantities"))
    for name, count in names.items():
        if name is not None and count > 1:
            yield Problem(
                sections.document.where(("wiring", "quantities")),
                f"{name} is wired {count} times",
                allowed="each name once",
            )


def _no_such_link(sections: Sections, kind: str, links: int) -> Iterator[Problem]:
    for i, wire in _entries(sections.wiring, kind):
        if wire.link is not None and wire.link > links:
            yield Problem(
                sections.document.where(("wiring", kind, i, "link")),
                "there is no such link",
                value=str(wire.link),
                allowed=f"1..{links}" if links else "none: compd knows no links of this machine",
            )


def _scale_problems(sections: Sections, count: int) -> Iterator[Problem]:
    """Each actuator has one scale, or none has one; where it extends one rod, its number is that of the link."""
    yield from _no_such_link(sections, "scale", count)
    scales = Counter(wire.link for _, wire in _entries(sections.wiring, "scale"))
    least = 1 if scales and _is_whole(sections.wiring, "scale", "link") else 0
    for link in range(1, count + 1):
        if not least <= scales[link] <= 1:
            yield Problem(
                sections.document.where(("wiring", "scale")),
                f"link {link} has {scales[link]} scales",
                allowed=f"links 1..{count}, each exactly one; or none of them",
            )


def _joint_problems(sections: Sections, links: int) -> Iterator[Problem]:
    yield from _no_such_link(sections, "joint", links)
    if not (_is_whole(sections.wiring, "joint", "link") and _is_whole(sections.wiring, "joint", "role")):
        return
    joints_by_link: dict[int, list[Any]] = defaultdict(list)
    for _, wire in _entries(sections.wiring, "joint"):
        joints_by_link[wire.link].append(wire)
    for link, wires in sorted(joints_by_link.items()):
        roles = Counter(wire.role for wire in wires)
        if max(roles.values()) > 1 or roles["Ra"] != roles["Rb"] or (roles["B"] and roles["Ra"]):
            yield Problem(
                sections.document.where(("wiring", "joint")),
                f"link {link} has comparators {', '.join(sorted(roles.elements()))}",
                allowed="at most one S, and either one B or Ra and Rb together",
            )
