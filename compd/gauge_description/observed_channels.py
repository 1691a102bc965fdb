"""Names, units and ranges of the numbers in a gauge's replies: the known ones, and the open questions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from compd.errors import Problem
from compd.gauge_description.answers import SKIPPED, UNKNOWN, Answers
from compd.gauge_description.observed_exchange import ObservedExchange
from compd.gauge_description.unit_words import WIRE_UNITS
from compd.units import unit_factor


class ObservedChannels:
    """The channels in all exchanges; `problems`: the open questions on them."""

    def __init__(self, exchanges: Sequence[ObservedExchange], answers: Answers) -> None:
        self.problems: list[Problem] = []
        self._answers = answers
        places = [(exchange, k) for exchange in exchanges for k in exchange.numbers]
        names = answers.names
        self._in_question: set[tuple[bytes, int]] = set()
        if not names:
            names = ("value",) if len(places) == 1 else tuple(str(k + 1) for k in range(len(places)))
            self._ask_for_names(places)
        if len(names) != len(places):
            shown = ", ".join(exchange.texts(k)[0].strip() for exchange, k in places)
            self.problems.append(
                Problem(
                    "--names",
                    f"{len(names)} names for {len(places)} numbers",
                    value=",".join(names),
                    next_step=f"a name for each of {shown}; {SKIPPED} skips one",
                )
            )
        self._names = {(exchange.request, k): name for (exchange, k), name in zip(places, names, strict=False)}
        self._read = [place for place, name in zip(places, names, strict=False) if name != SKIPPED]
        if not self._read:
            self.problems.append(Problem("--names", "skips every number", value=",".join(names)))
        units = self._for_each("--unit", "units", answers.units)
        self._ranges = self._for_each("--range", "ranges", answers.ranges)
        self._units = {
            (exchange.request, k): _unit(exchange.units(k), given)
            for (exchange, k), given in zip(self._read, units or [""] * len(self._read), strict=True)
        }
        self._ask_for_units()
        if not answers.ranges:
            self._ask_for_ranges()

    @property
    def single(self) -> bool:
        """Whether there is a single channel, which needs no name in the replies."""
        return len(self._read) == 1

    def is_read(self, exchange: ObservedExchange, k: int) -> bool:
        """Whether column `k` of the exchange is a channel."""
        return (exchange.request, k) in self._units

    def is_in_question(self, exchange: ObservedExchange, k: int) -> bool:
        """Whether it is open if column `k` is a measurement at all."""
        return (exchange.request, k) in self._in_question

    def name(self, exchange: ObservedExchange, k: int) -> str:
        """Name of the number in column `k`: SKIPPED for an unread one, "" for a constant that is no channel."""
        return self._names.get((exchange.request, k), "")

    def unit(self, exchange: ObservedExchange, k: int) -> str:
        """Unit on the wire of the channel in column `k`; "" if unknown."""
        return self._units[exchange.request, k]

    def options(self) -> list[dict[str, Any]]:
        """The channels as a description writes them."""
        channels = []
        for (exchange, k), limits in zip(self._read, self._ranges, strict=True):
            channel: dict[str, Any] = {"name": self.name(exchange, k), "unit": self.unit(exchange, k)}
            if exchange.is_whole(k) and self._answers.decimals:
                channel["decimals"] = self._answers.decimals
            if limits != UNKNOWN:
                channel["range"] = list(limits)
            channels.append(channel)
        return channels

    def _ask_for_names(self, places: Sequence[tuple[ObservedExchange, int]]) -> None:
        bare = [exchange.is_whole(k) for exchange, k in places]
        if not any(bare) or all(bare):
            return
        self._in_question = {(exchange.request, k) for (exchange, k), whole in zip(places, bare, strict=True) if whole}
        shown = [exchange.texts(k)[0].strip() for exchange, k in places]
        skip = ",".join(SKIPPED if whole else f"c{k + 1}" for k, whole in enumerate(bare))
        self.problems.append(
            Problem(
                "--names",
                "whole numbers that change stand beside the others: counters, a clock, a status?",
                value=", ".join(text for text, whole in zip(shown, bare, strict=True) if whole),
                next_step=f"name each of {', '.join(shown)}, or skip it by {SKIPPED}: --names={skip}",
            )
        )

    def _ask_for_units(self) -> None:
        for exchange, k in self._read:
            reply_units, unit = exchange.units(k), self.unit(exchange, k)
            where = "--unit" if self.single else f"--unit of {self.name(exchange, k)}"
            if not unit:
                self.problems.append(
                    Problem(
                        where,
                        f"which unit has the number? the replies {_units_text(reply_units)}",
                        value=exchange.texts(k)[0].strip(),
                        next_step="--unit mm (um, inch, degC ...); --unit mm,inch where each channel has its own",
                    )
                )
            elif reply_units != [""] and any(
                other not in ("", unit) and _factor(other, unit, reply_units) is None for other in reply_units
            ):
                self.problems.append(
                    Problem(
                        where,
                        "the replies name another unit",
                        value=unit,
                        allowed=", ".join(filter(None, reply_units)),
                        next_step="leave out --unit, or set the device to one unit; to multiply the number, "
                        f"--factors {reply_units[-1]}=FACTOR; if it is no unit, --ignore its letters",
                    )
                )

    def _ask_for_ranges(self) -> None:
        self.problems.append(
            Problem(
                "--range",
                "which values can the sensor deliver? what is beyond them is no measurement",
                allowed="LOWEST,HIGHEST in mm (degC ...); once for each channel, or once for all",
                next_step=f"--range=-25,25, from the manual; --range {UNKNOWN} where it does not say",
            )
        )

    def _for_each(self, where: str, what: str, given: Sequence[Any]) -> list[Any]:
        """One range for each channel; a single given one is for all."""
        if len(given) == 1:
            return [given[0]] * len(self._read)
        if given and len(given) != len(self._read):
            text = f"{len(given)} {what} for {len(self._read)} channels"
            self.problems.append(Problem(where, text, allowed="one for each channel, or one for all"))
            return [given[0]] * len(self._read)
        return list(given)


def _unit(reply_units: Sequence[str], given: str) -> str:
    """Unit of a number on the wire: the person's, else that of the replies; mm if they change between units."""
    units = [unit for unit in reply_units if unit in WIRE_UNITS]
    return given or ("mm" if "mm" in units else units[0] if units else "")


def _units_text(reply_units: Sequence[str]) -> str:
    units = [unit for unit in reply_units if unit]
    return f"say {', '.join(units)}, which is none of a channel" if units else "do not say it"


def _factor(other: str, unit: str, reply_units: Sequence[str]) -> float | None:
    """Factor of a number in `other` if the replies name the unit of each number."""
    return unit_factor(other, unit) if len(reply_units) > 1 else None
