"""Descriptions of unknown gauges from their replies: what was captured is read, and nothing that looks like it."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.commissioning.capture import read_capture
from compd.commissioning.describe import describe_replies, read_replies
from compd.errors import CompdError
from compd.plugins import GAUGES, load

OBSERVED = {
    "fixed decimals": (b"?\r", [b"+0001.23\r\n", b"-0012.30\r\n", b"+0000.00\r\n"], ["1.23", "-12.3", "0"]),
    "two heads": (
        b"M0\r\n",
        [b"M0,+000.1234,-001.0000\r\n", b"M0,-000.1234,-001.5000\r\n", b"M0,+010.1234,-001.0000\r\n"],
        ["0.1234, -1", "-0.1234, -1.5", "10.1234, -1"],
    ),
    "leading blanks": (
        b"\x02",
        [b"+    12.3456    \r\n", b"-     2.3456 >  \r\n", b"      0.0001 <  \r\n"],
        ["12.3456", "-2.3456", "0.0001"],
    ),
    "no fixed width": (b"?\r", [b" 1.234\r", b"-12.345\r", b" 0.001\r"], ["1.234", "-12.345", "0.001"]),
    "unasked": (b"", [b"GS,  12.3,kg\r\n", b"NT,  -2.3,kg\r\n", b"GS,   0.0,kg\r\n"], ["12.3", "-2.3", "0"]),
    "no terminator": (b"R", [b"A+1.234", b"A-0.500", b"A+0.001"], ["1.234", "-0.5", "0.001"]),
    "percent": (b"R", [b"12345%\r", b"00345%\r", b"-0001%\r"], ["12345", "345", "-1"]),
}


@pytest.mark.parametrize("case", OBSERVED)
def test_learned_description_reads_what_was_observed(case: str) -> None:
    request, replies, values = OBSERVED[case]
    learned = describe_replies(request, replies, "mm", ignored="GSNT" if case == "unasked" else "")
    assert read_replies(learned, load(GAUGES, "serial_ascii", "x"), replies) == values


@pytest.mark.parametrize(
    ("replies", "unit", "question"),
    [
        ([b"+001.234mm\r", b"+123.400um\r", b"-000.500mm\r"], "mm", "is it a sign, a unit, a side or a status"),
        ([b"0012.300-\r", b"0012.400+\r", b"0000.500-\r"], "mm", "is it a sign, a unit, a side or a status"),
        ([b"0012.300-\r", b"0012.400 \r", b"0000.500-\r"], "mm", "is it a sign, a unit, a side or a status"),
        ([b"0012.300-\r", b"0010.400-\r", b"0000.500-\r"], "mm", "behind a number: is it the sign"),
        ([b"L0012.300\r", b"R0012.400\r", b"L0000.500\r"], "mm", "is it a sign, a unit, a side or a status"),
        ([b"12012.300\r", b"12000.500\r", b"12003.100\r"], "mm", "begins with 120 .* an address or a status"),
        ([b"01012.300\r", b"01100.500\r", b"01003.100\r"], "mm", "begins with 01 .* an address or a status"),
        ([b"-012.30007\r", b"+001.23041\r", b"+000.50013\r"], "mm", "5 decimals of mm: .* a checksum"),
        ([b"+001.230\r", b"+999.999\r", b"-000.500\r"], "mm", "all nines: does it stand for an error"),
        ([b"+0001,230\r", b"-0012,300\r", b"+0000,500\r"], "mm", "a decimal comma"),
    ],
)
def test_what_may_belong_to_a_number_is_asked_and_never_thrown_away(
    replies: list[bytes], unit: str, question: str
) -> None:
    with pytest.raises(CompdError, match=question):
        describe_replies(b"?\r", replies, unit)


def test_every_question_is_asked_at_once() -> None:
    with pytest.raises(CompdError) as caught:
        describe_replies(b"?\r", [b"L0012.300-\r", b"R0012.40007\r"[:10] + b"-\r", b"L9999.999-\r"], "mm")
    assert len(caught.value.problems) >= 3


def test_the_answers_to_the_questions() -> None:
    driver = load(GAUGES, "serial_ascii", "x")
    judged = [b"U+0012.300\r", b"G+0012.400\r", b"L-0000.500\r"]
    learned = describe_replies(b"?\r", judged, "mm", ignored="UGL")
    assert read_replies(learned, driver, judged) == ["12.3", "12.4", "-0.5"]
    glued = [b"-012.30007\r", b"+001.23041\r", b"+000.50013\r"]
    learned = describe_replies(b"?\r", glued, "mm", decimals=3)
    assert learned.options["in"] == "%+08.3f%*2[0-9]"
    assert read_replies(learned, driver, glued) == ["-12.3", "1.23", "0.5"]
    learned = describe_replies(b"?\r", glued, "mm", decimals=5)
    assert read_replies(learned, driver, glued) == ["-12.3001", "1.23041", "0.50013"]
    over = [b"+001.230\r", b"+999.999\r", b"-000.500\r", b"+000.700\r"]
    learned = describe_replies(b"?\r", over, "mm", errors={b"+999.999": "over_range"})
    assert read_replies(learned, driver, over) == ["1.23", "over_range", "-0.5", "0.7"]


def test_an_exponent_belongs_to_its_number() -> None:
    replies = [b"+1.234567E-03\r", b"-2.500000E-01\r", b"+9.990000E+00\r"]
    learned = describe_replies(b"?\r", replies, "1")
    assert learned.options["in"] == "%+13.6e"
    assert read_replies(learned, load(GAUGES, "serial_ascii", "x"), replies) == ["0.00123457", "-0.25", "9.99"]


def test_learned_description_is_narrow() -> None:
    request, replies, _ = OBSERVED["fixed decimals"]
    learned = describe_replies(request, replies, "mm")
    for damaged in (b"+001.23\r\n", b"+0001.2\r\n", b"+0001.234\r\n", b"0001.23\r\n", b"+00x1.23\r\n", b"\r\n"):
        with pytest.raises(CompdError, match="does not fit"):
            read_replies(learned, load(GAUGES, "serial_ascii", "x"), [damaged])


@pytest.mark.parametrize(
    ("replies", "message"),
    [
        ([b"+1.23\r\n", b"+1.23\r\n", b"+1.23\r\n"], "too few that differ"),
        ([b"+1.23\r\n", b"ERR0\r\n", b"+1.24\r\n", b"+1.25\r\n"], "reply 2, character"),
        ([b"+1.23", b"+11.23", b"+1.25"], "no terminator in common"),
        ([b"a\r", b"b\r", b"c\r"], "no number"),
        ([], "there is none"),
        ([b"1.0,2.0\r", b"1.1,2.1\r", b"1.2\r"], "reply 3"),
    ],
)
def test_inconsistent_replies_are_refused_with_their_place(replies: list[bytes], message: str) -> None:
    with pytest.raises(CompdError, match=message):
        describe_replies(b"?", replies, "mm")


def test_a_capture_that_cannot_be_read_is_named_by_its_line(tmp_path: Path) -> None:
    capture = tmp_path / "capture.txt"
    capture.write_text("> 3F\n< 2G\n")
    with pytest.raises(CompdError, match=r"capture.txt:2"):
        read_capture(capture)
    capture.write_text("> 3F\n> 40\n")
    with pytest.raises(CompdError, match="another request"):
        read_capture(capture)
