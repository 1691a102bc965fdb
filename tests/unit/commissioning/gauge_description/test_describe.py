"""Descriptions of unknown gauges from their replies: what was captured is read, and nothing that looks like it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from compd.errors import CompdError
from compd.gauge_description import Answers, learn_gauge
from compd.gauge_description.capture import CapturedReply
from compd.gauge_description.describe import describe_replies, read_back
from compd.plugins import GAUGES, load
from compd_drivers.serial_ascii import SerialAscii

ANSWERED: dict[str, Any] = {"units": ("mm",), "ranges": ("unknown",)}


def learn(replies: Sequence[bytes], request: bytes = b"?\r", **answers: Any) -> tuple[dict[str, Any], list[str]]:
    """Options and values of a gauge in mm whose range is not known."""
    captured = [CapturedReply(request, reply) for reply in replies]
    description, values = learn_gauge(captured, Answers(**{**ANSWERED, **answers}))
    return dict(description.options), values


def questions(replies: Sequence[bytes], **answers: Any) -> str:
    """All questions, as a person reads them."""
    with pytest.raises(CompdError) as caught:
        learn(replies, **answers)
    return str(caught.value)


OBSERVED: dict[str, tuple[list[bytes], dict[str, Any], str, list[str]]] = {
    "fixed decimals": ([b"+0001.23\r\n", b"-0012.30\r\n", b"+0000.00\r\n"], {}, "%+08.2f", ["1.23", "-12.3", "0"]),
    "two heads": (
        [b"M0,+000.1234,-001.0000\r\n", b"M0,-000.1234,-001.5000\r\n", b"M0,+010.1234,-001.0000\r\n"],
        {},
        "M0,%(1)+09.4f,%(2)+09.4f",
        ["0.1234, -1", "-0.1234, -1.5", "10.1234, -1"],
    ),
    "several lines": (
        [
            b"GN01,+00001.23\r\nGN02,-00004.56\r\n",
            b"GN01,-00012.30\r\nGN02,+00000.01\r\n",
            b"GN01,+1.1\r\nGN02,+2.2\r\n",
        ],
        {},
        r"GN01,%(1)+f\r\nGN02,%(2)+f",
        ["1.23, -4.56", "-12.3, 0.01", "1.1, 2.2"],
    ),
    "judgements": (
        [b"+    12.3456    \r\n", b"-     2.3456 >  \r\n", b"      0.0001 <  \r\n"],
        {},
        "% 12.4f %*1[ <>]  ",
        ["12.3456", "-2.3456", "0.0001"],
    ),
    "no fixed width": ([b" 1.234\r", b"-12.345\r", b" 0.001\r"], {}, "%.3f", ["1.234", "-12.345", "0.001"]),
    "states that do not matter": (
        [b"GS,  12.3,kg\r\n", b"NT,  -2.3,kg\r\n", b"GS,   0.0,kg\r\n"],
        {"request": b"", "ignored": "GSNT"},
        "%*1[GN]%*1[ST],% 6.1f,kg",
        ["12.3", "-2.3", "0"],
    ),
    "no terminator": ([b"A+1.234", b"A-0.500", b"A+0.001"], {}, "A%+6.3f", ["1.234", "-0.5", "0.001"]),
    "an echo and a prompt": (
        [b"?\r+1.234\r\n>", b"?\r-1.200\r\n>", b"?\r+0.004\r\n>"],
        {},
        r"?\r%+6.3f\r\n>",
        ["1.234", "-1.2", "0.004"],
    ),
    "channel digit, then a sign or a blank": (
        [b"1 012.345\r", b"1-012.300\r", b"1 000.100\r"],
        {},
        "1% 8.3f",
        ["12.345", "-12.3", "0.1"],
    ),
    "whole numbers": ([b"12345%\r", b"00345%\r", b"-0001%\r"], {"decimals": 3}, "%5d%%", ["12.345", "0.345", "-0.001"]),
    "exponents": (
        [b"+1.234567E-03\r", b"-2.500000E-01\r", b"+9.990000E+00\r"],
        {},
        "%+13.6e",
        ["0.00123457", "-0.25", "9.99"],
    ),
    "exponents without a point": ([b"1E-3\r", b"2E-1\r", b"9E+0\r"], {}, "%4.0e", ["0.001", "0.2", "9"]),
    "a decimal comma": (
        [b"+0001,230\r", b"-0012,300\r", b"+0000,500\r"],
        {},
        "%+09.3f",
        ["1.23", "-12.3", "0.5"],
    ),
    "two numbers with decimal commas": (
        [b"+01,230;-01,500\r", b"-12,300;+01,400\r", b"+00,500;+00,001\r"],
        {},
        "%(1)+7.3f;%(2)+07.3f",
        ["1.23, -1.5", "-12.3, 1.4", "0.5, 0.001"],
    ),
    "a decimal comma without signs, answered": (
        [b"0001,230\r", b"0012,300\r", b"0000,500\r"],
        {"decimal_mark": ","},
        "%08.3f",
        ["1.23", "12.3", "0.5"],
    ),
    "a counter and a clock, skipped": (
        [b"17 12:34:56 +001.230\r", b"18 12:34:59 -012.300\r", b"19 12:35:03 +000.500\r"],
        {"names": ("-", "-", "-", "a")},
        "%*2[0-9] %*2[0-9]:%*2[0-9]:%*2[0-9]%+9.3f",
        ["1.23", "-12.3", "0.5"],
    ),
    "the unit by a table": (
        [b"+001.234mm\r", b"+123.400um\r", b"-000.500mm\r"],
        {"units": ()},
        "%+8.3f%{mm=1|um=0.001}",
        ["1.234", "0.1234", "-0.5"],
    ),
    "units of other lengths": (
        [b"+01.234mm\r", b'+01.234"\r', b"-00.500mm\r"],
        {},
        '%+07.3f%{"=25.4|mm=1}',
        ["1.234", "31.3436", "-0.5"],
    ),
    "one unit": ([b"+1.234mm\r", b"+0.400mm\r", b"-0.500mm\r"], {"units": ()}, "%+6.3fmm", ["1.234", "0.4", "-0.5"]),
    "each number with its unit": (
        [b"+1.270 mm +0.05000 in\r", b"+2.540 mm +0.10000 in\r", b"-1.270 mm -0.05000 in\r"],
        {"units": ()},
        "%(1)+6.3f mm%(2)+9.5f in",
        ["1.27, 1.27", "2.54, 2.54", "-1.27, -1.27"],
    ),
    "a sign behind, answered": (
        [b"0012.300-\r", b"0012.400+\r", b"0000.500-\r"],
        {"factors": ("+=1|-=-1",)},
        "%08.3f%{+=1|-=-1}",
        ["-12.3", "12.4", "-0.5"],
    ),
    "a sign behind or nothing, answered": (
        [b"0012.300-\r", b"0012.400\r", b"0000.500-\r"],
        {"factors": ("=1|-=-1",)},
        "%08.3f%{=1|-=-1}",
        ["-12.3", "12.4", "-0.5"],
    ),
    "a letter as the sign, of which one was seen": (
        [b"L0012.300\r", b"L0012.400\r", b"L0000.500\r"],
        {"factors": ("L=-1|R=1",)},
        "%{L=-1|R=1}%08.3f",
        ["-12.3", "-12.4", "-0.5"],
    ),
    "metres by their factor": (
        [b"+1.5 m\r", b"+2.5 m\r", b"-1.0 m\r"],
        {"factors": ("m=1000",)},
        "%+4.1f %{m=1000}",
        ["1500", "2500", "-1000"],
    ),
    "a decimal comma and exponents": (
        [b"+1,5E-3\r", b"+2,5E-2\r", b"-1,0E+0\r"],
        {},
        "%+7.1e",
        ["0.0015", "0.025", "-1"],
    ),
    "parentheses, answered": (
        [b"(27.691)\r", b"(10.090)\r", b"(17.102)\r"],
        {"factors": ("(=-1",)},
        "%{(=-1}%6.3f)",
        ["-27.691", "-10.09", "-17.102"],
    ),
    "a list before a decimal comma": (
        [b"A,0-0017,207\r", b"A,0+0002,010\r", b"A,0-0001,500\r"],
        {},
        "A,0%+09.3f",
        ["-17.207", "2.01", "-1.5"],
    ),
    "an address that is no clock": (
        [b"12:012.300\r", b"12:100.500\r", b"12:003.100\r"],
        {"plain": True},
        "12:%7.3f",
        ["12.3", "100.5", "3.1"],
    ),
    "a glued address": (
        [b"12012.300\r", b"12000.500\r", b"12003.100\r"],
        {"constants": ("12",)},
        "12%07.3f",
        ["12.3", "0.5", "3.1"],
    ),
    "nothing glued": (
        [b"12012.300\r", b"12000.500\r", b"12003.100\r"],
        {"plain": True},
        "%9.3f",
        ["12012.3", "12000.5", "12003.1"],
    ),
    "digits of a checksum that is not known": (
        [b"-012.30007\r", b"+001.23042\r", b"+000.50013\r"],
        {"decimals": 3},
        "%+08.3f%*2[0-9]",
        ["-12.3", "1.23", "0.5"],
    ),
    "a checksum that is not known": (
        [b"+012.300q\r", b"-002.300Z\r", b"+000.001!\r"],
        {"skipped_end": 1},
        "%+08.3f%*1c",
        ["12.3", "-2.3", "0.001"],
    ),
    "all nines with a status": (
        [b"0+001.230\r", b"3+999.999\r", b"0-000.500\r", b"0+000.700\r"],
        {"errors": {b"3+999.999": "over_range"}},
        "0%+08.3f",
        ["1.23", "over_range", "-0.5", "0.7"],
    ),
}


@pytest.mark.parametrize("case", OBSERVED)
def test_learned_description_reads_what_was_observed(case: str) -> None:
    replies, answers, form, values = OBSERVED[case]
    options, learned = learn(replies, **answers)
    assert (options["in"], learned) == (form, values)


QUESTIONS: dict[str, tuple[list[bytes], str, str]] = {
    "sign behind": ([b"0012.300-\r", b"0012.400+\r", b"0000.500-\r"], "varies beside a number", "--factors='+=1|-=-1'"),
    "sign or blank behind": ([b"12.300-\r", b"12.400 \r", b"00.500-\r"], "varies beside a number", " =1|-=-1"),
    "sign or nothing behind": ([b"12.300-\r", b"12.400\r", b"00.500-\r"], "varies beside a number", "='=1|-=-1"),
    "one sign behind": ([b"0012.300-\r", b"0010.400-\r", b"0000.500-\r"], "is it the sign?", "--factors='+=1|-=-1'"),
    "letters": ([b"L0012.300\r", b"R0012.400\r", b"L0000.500\r"], "varies beside a number", "--ignore='LR'"),
    "a letter of a pair": ([b"L0012.300\r", b"L0012.400\r", b"L0000.500\r"], "the letter L before", "--ignore=L"),
    "unit letters": ([b"+01.234m\r", b"+23.400u\r", b"-00.500m\r"], "is it a sign, a unit", "m=FACTOR|u=FACTOR"),
    "a mark": ([b"+01.234 \r", b"+23.400?\r", b"-00.500 \r"], "varies beside a number", "--ignore='?'"),
    "an address": ([b"12012.300\r", b"12000.500\r", b"12003.100\r"], "begins with 120", "--constant"),
    "an address with zero": ([b"01012.300\r", b"01100.500\r", b"01003.100\r"], "begins with 01", "--plain"),
    "a status": ([b"1104.375\r", b"0107.943\r", b"0109.159\r"], "its first digit changes", "--plain"),
    "a glued exponent": ([b"121.5E-03\r", b"122.5E-03\r", b"123.5E-04\r"], "has an exponent and several", "--constant"),
    "glued to an exponent": ([b"+2.5E+0101\r", b"+5.5E+0055\r", b"+2.4E+0173\r"], "of its exponent", "--skip-end"),
    "parentheses": ([b"(27.691)\r", b"(10.090)\r", b"(17.102)\r"], "does that mean minus", "--factors '(=-1'"),
    "decimals": ([b"-012.30007\r", b"+001.23042\r", b"+000.50013\r"], "5 decimals of mm", "--decimals 3"),
    "nines": ([b"+001.230\r", b"+999.999\r", b"-000.500\r"], "all nines", "--error"),
    "decimal comma": ([b"0001,230\r", b"0012,300\r", b"0000,500\r"], "is it a decimal comma?", "--decimal-mark ,"),
    "a list or a German number": ([b"1.234,50\r", b"1.235,60\r", b"2.236,70\r"], "a decimal comma?", "without points"),
    "blanks between thousands": ([b"1 234.567\r", b"1 034.567\r", b"1 234.500\r"], "groups of three", "--constant 1"),
    "commas between thousands": ([b"1,234.567\r", b"2,034.567\r", b"1,234.500\r"], "groups of three", "--names"),
    "whole": ([b"12345\r", b"00345\r", b"30001\r"], "is a whole number", "--decimals 3"),
    "a counter": ([b"17 +1.230\r", b"18 -2.300\r", b"19 +0.500\r"], "counters, a clock, a status", "--names=-,c2"),
    "a sign behind a unit": ([b"12.300 mm -\r", b"12.400 mm -\r", b"00.500 mm -\r"], "is it the sign?", "--ignore=-"),
    "a comma and other lengths": ([b"+1,5\r", b"+12,25\r", b"-0,125\r"], "a decimal comma?", "--decimal-mark ,"),
    "another unit": ([b"+1.5 mV\r", b"+2.5 mV\r", b"-1.0 mV\r"], "the replies name another unit", "mV=FACTOR"),
    "metres": ([b"+1.5 m\r", b"+2.5 m\r", b"-1.0 m\r"], "the replies name another unit", "m=FACTOR"),
    "a date": ([b"2026-11-23 1.23\r", b"2026-11-24 1.24\r", b"2026-11-25 9.87\r"], "a clock", "--names=-,-,c3"),
    "a checksum": ([b"+012.300q\r", b"-002.300Z\r", b"+000.001!\r"], "none of sum8, negative_sum8", "--skip-end 1"),
}  # fmt: skip


@pytest.mark.parametrize("case", QUESTIONS)
def test_what_may_belong_to_a_number_is_asked_with_the_option_that_answers_it(case: str) -> None:
    replies, question, option = QUESTIONS[case]
    text = questions(replies)
    assert question in text
    assert option in text


def test_unit_and_range_are_asked_unless_they_are_known() -> None:
    plain = [b"+1.234\r", b"+0.400\r", b"-0.500\r"]
    text = questions(plain, units=(), ranges=())
    assert "which unit has the number? the replies do not say it" in text
    assert "which values can the sensor deliver?" in text
    assert "--range unknown where it does not say" in text
    options, values = learn(plain, ranges=((-1.0, 1.0),))
    assert options["channels"] == [{"name": "value", "unit": "mm", "range": [-1.0, 1.0]}]
    assert values == ["over_range", "0.4", "-0.5"]


def test_a_unit_in_the_replies_is_not_overruled() -> None:
    inches = [b"+1.270 mm +0.0500 in\r", b"+2.540 mm +0.1000 in\r", b"-1.270 mm -0.0500 in\r"]
    text = questions(inches)
    assert "--unit of 2: the replies name another unit" in text
    assert "allowed: inch" in text
    options, _ = learn(inches, units=("mm", "inch"))
    assert [channel["unit"] for channel in options["channels"]] == ["mm", "inch"]
    options, _ = learn(inches, units=("mm",), ignored="in")
    assert [channel["unit"] for channel in options["channels"]] == ["mm", "mm"]


def test_a_decimal_comma_stands_in_the_description() -> None:
    options, _ = learn([b"+0001,230\r", b"-0012,300\r", b"+0000,500\r"])
    assert options["decimal_mark"] == ","


def test_every_question_is_asked_at_once() -> None:
    with pytest.raises(CompdError) as caught:
        learn([b"L0012.300-\r", b"R0012.400-\r", b"L9999.999-\r"], units=(), ranges=())
    assert len(caught.value.problems) == 5


def test_several_requests_are_one_gauge() -> None:
    captured = [
        CapturedReply(request, reply)
        for replies in ((b"+1.230\r", b"+5.230\r"), (b"-1.230\r", b"+2.230\r"), (b"+0.230\r", b"+0.130\r"))
        for request, reply in zip((b"M1\r", b"M2\r"), replies, strict=True)
    ]
    description, values = learn_gauge(captured, Answers(**ANSWERED, names=("p1", "p2")))
    assert values == ["1.23, 5.23", "-1.23, 2.23", "0.23, 0.13"]
    assert description.options["requests"] == [
        {"out": r"M1\r", "in": "%(p1)+6.3f"},
        {"out": r"M2\r", "in": "%(p2)+6.3f"},
    ]


def test_learned_description_is_narrow() -> None:
    options, _ = learn([b"+0001.23\r\n", b"-0012.30\r\n", b"+0000.00\r\n"])
    for damaged in (b"+001.23\r\n", b"+0001.2\r\n", b"+0001.234\r\n", b"0001.23\r\n", b"+00x1.23\r\n", b"\r\n"):
        with pytest.raises(CompdError, match="does not fit"):
            read_back(options, SerialAscii, [CapturedReply(b"?\r", damaged)])


def test_another_unit_than_the_one_that_was_seen_is_refused() -> None:
    options, _ = learn([b"+1.234mm\r", b"+0.400mm\r", b"-0.500mm\r"])
    with pytest.raises(CompdError, match="does not fit"):
        read_back(options, load(GAUGES, "serial_ascii", "x"), [CapturedReply(b"?\r", b"+1.234um\r")])


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
        describe_replies([CapturedReply(b"?", reply) for reply in replies], Answers(**ANSWERED))
