"""Devices made up at random: what is learned of one gives its values, of replies that were not captured too, or none.

The devices are written here without the code that learns. Two things cannot be seen in replies, and are left out: a
status digit glued to a number that never has a sign, and digits of an unknown checksum among usual decimals.
"""

from __future__ import annotations

import functools
import operator
import random
from collections.abc import Callable, Mapping
from typing import NamedTuple

import pytest

from compd.errors import CompdError
from compd.gauge import LineFault
from compd.gauge_description import Answers, learn_gauge
from compd.gauge_description.capture import CapturedReply
from compd_drivers.serial_ascii import SerialAscii
from tests.support.ascii_gauge import line_with
from tests.support.sampled import sampled

DEVICES_OF_A_RUN = 300
SIGNS: Mapping[str, Callable[[str, bool], str]] = {
    "in front": lambda number, minus: "+-"[minus] + number,
    "behind": lambda number, minus: number + "+-"[minus],
    "behind or blank": lambda number, minus: number + " -"[minus],
    "behind or nothing": lambda number, minus: number + "-" * minus,
    "a letter": lambda number, minus: "RL"[minus] + number,
    "parentheses": lambda number, minus: f"({number})" if minus else f" {number} ",
}
GLUED: Mapping[str, Callable[[int], str]] = {
    "nothing": lambda count: "",
    "an address": lambda count: "12",
    "a counter": lambda count: f"{count:04d},",
    "a clock": lambda count: f"12:34:{count % 60:02d} ",
}
CHECKSUMS: Mapping[str, Callable[[bytes], bytes]] = {
    "none": lambda text: b"",
    "exclusive or": lambda text: b"%02X" % functools.reduce(operator.xor, text),
    "sum": lambda text: b"%02X" % (sum(text) % 256),
    "two decimal digits": lambda text: b"%02d" % (sum(text) % 100),
    "unknown": lambda text: bytes([33 + sum(byte * byte for byte in text) % 90]),
}


class Device(NamedTuple):
    """How it writes a length in mm."""

    sign: str
    glued: str
    checksum: str
    unit: str
    form: str
    comma: bool
    before: str

    @classmethod
    def made_by(cls, source: random.Random) -> Device:
        form = f"{source.choice(['', '0'])}{source.choice(['', '8', '9'])}.{source.choice('23')}f"
        return cls(
            source.choice(list(SIGNS)),
            source.choice(list(GLUED)),
            source.choice(list(CHECKSUMS)),
            source.choice(["", "mm", " mm", "um in turn", "inch in turn"]),
            form,
            source.random() < 0.2,
            source.choice(["", "", "01A", "A,", "X=", "\x02"]),
        )

    def reply(self, value_mm: float, count: int) -> tuple[bytes, float]:
        """The reply, and the value that its digits stand for, mm."""
        unit, mm = self.unit, 1.0
        if unit.endswith("in turn"):
            unit, mm = {True: ("mm", 1.0), False: ("um", 1e-3) if "um" in unit else ("in", 25.4)}[value_mm > 0]
        number = format(abs(value_mm / mm), self.form)
        shown = float(number) * mm * (-1 if value_mm < 0 else 1)
        text = SIGNS[self.sign](number.replace(".", ",") if self.comma else number, value_mm < 0)
        body = f"{self.before}{GLUED[self.glued](count)}{text}{unit}".encode("ascii")
        return body + CHECKSUMS[self.checksum](body) + b"\r", shown


@pytest.mark.parametrize("run", sampled(range(3), 3))
def test_what_is_learned_without_a_question_is_right(run: int) -> None:
    learned = 0
    for seed in range(run * DEVICES_OF_A_RUN, (run + 1) * DEVICES_OF_A_RUN):
        source = random.Random(seed)
        device, largest_mm = Device.made_by(source), source.choice([5, 30, 200])
        # some are captured on one side alone
        lowest_mm = source.choice([-largest_mm, 0])
        observed = [device.reply(source.uniform(lowest_mm, largest_mm), count) for count in range(6)]
        captured = [CapturedReply(b"?\r", reply) for reply, _ in observed]
        try:
            description, _ = learn_gauge(captured, Answers(units=("mm",), ranges=("unknown",)))
        except CompdError:
            continue
        learned += 1
        later = [device.reply(source.uniform(-largest_mm, largest_mm), count) for count in range(6, 26)]
        gauge = SerialAscii(SerialAscii.Options.model_validate({**description.options, "line": "x"}))
        for reply, value_mm in [*observed, *later]:
            line, _ = line_with(device=lambda request, reply=reply: reply)
            try:
                readings = gauge.read(line)
            except LineFault:  # refused: it is not what was seen
                continue
            assert len(readings) == 1, (seed, device, reply)
            assert not readings[0].ok or readings[0].value == pytest.approx(value_mm, abs=1e-9), (seed, device, reply)
    assert learned > DEVICES_OF_A_RUN // 20
