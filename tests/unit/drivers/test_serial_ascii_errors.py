"""Errors before values, and descriptions of a serial gauge that cannot be right."""

from __future__ import annotations

import importlib
import textwrap
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from compd.gauge import Quality
from compd_drivers.reply_format import ReplyFormat
from compd_drivers.serial_ascii import SerialAscii
from tests.support.ascii_gauge import CHANNEL, gauge, poll


@pytest.mark.parametrize(
    ("form", "error", "reply", "quality"),
    [
        ("%+08.3f", {"in": "+999.999", "quality": "over_range"}, b"+999.999", Quality.OVER_RANGE),
        ("%*1[0-9],%+08.3f", {"in": "3,%*8c", "quality": "sensor_fault"}, b"3,+001.234", Quality.SENSOR_FAULT),
        ("%+08.3f", {"in": "%*1[+-]999.999", "quality": "over_range"}, b"-999.999", Quality.OVER_RANGE),
    ],
)
def test_an_error_that_looks_like_a_value_is_an_error(
    form: str, error: dict[str, str], reply: bytes, quality: Quality
) -> None:
    device = gauge(**{"in": form, "errors": [error]})
    (reading,) = poll(device, reply + b"\r\n")
    assert reading.quality is quality
    (reading,) = poll(device, (b"1," if form.startswith("%*") else b"") + b"+001.234\r\n")
    assert reading.value == 1.234


@pytest.mark.parametrize(
    "options",
    [
        {"in": "%+08.3f", "errors": [{"in": "999", "quality": "over_range"}, {"in": "%*8c", "quality": "over_range"}]},
        {"in": "%f", "errors": [{"in": "%*s", "quality": "over_range"}]},
        {"in": "%+07.3f %0<sum8>", "errors": [{"in": "%*7c %*2c", "quality": "over_range"}]},
        {"in": "%4x", "errors": [{"in": "%*[0-9A-F]", "quality": "over_range"}]},
    ],
)
def test_an_error_that_fits_every_value_is_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="fits nearly every value"):
        gauge(**options)


def test_an_error_that_fits_half_of_the_values_is_a_matter_of_the_manual() -> None:
    gauge(**{"in": "%*1[01],%+08.3f", "errors": [{"in": "1,%*8c", "quality": "sensor_fault"}]})


@pytest.mark.parametrize(
    "form", ["%f", "%+09.4f", "% .3f", "%d", "%+06d", "%e", "%4x", "%+4x", "A%*2[0-9]%+07.2f %1<xor8>"]
)
def test_samples_of_a_form_are_replies_of_that_form(form: str) -> None:
    samples = list(ReplyFormat(form).samples(50))
    assert len(set(samples)) > 20
    assert all(ReplyFormat(form).match(sample) is not None for sample in samples)


# --- descriptions that cannot be right -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"in": "%(b)f"}, "has no"),
        ({"in": "%f", "channels": [CHANNEL, CHANNEL]}, "twice"),
        ({"in": "%(value)f %(other)f"}, "other"),
        ({"in": "OK"}, "has no"),
        ({"in": "%f", "in_terminator": ""}, "fixed length"),
        ({"in": "%+07.3f", "in_terminator": "", "errors": [{"in": "ERR", "quality": "device_error"}]}, "same length"),
        ({"in": "%f", "out": "", "echo": {"out": "ID?", "in": "TT"}}, "unsolicited"),
        ({"in": "%f", "channels": [{"name": "value", "unit": "V"}]}, "linearisation"),
        ({"in": "%f", "channels": [{"name": "value", "unit": "mm", "scale": 0}]}, "scale"),
        ({"in": "%f", "channels": [{"name": "value", "unit": "mm", "range": [1, -1]}]}, "range"),
        ({"in": "%f", "channels": [{"name": "value"}]}, "unit"),
        ({"in": "%y"}, "converter"),
        ({"in": "%+x"}, "two's complement needs the number's width"),
    ],
)
def test_a_description_that_cannot_be_right(options: dict[str, Any], why: str) -> None:
    with pytest.raises(ValidationError, match=why):
        gauge(**options)


def test_the_examples_in_the_drivers_text_are_descriptions() -> None:
    text = importlib.import_module(SerialAscii.__module__).__doc__ or ""
    blocks = [
        textwrap.dedent("\n".join(line for line in part.splitlines()[1:] if line.startswith("    ")))
        for part in text.split("\n\n")
        if "driver: serial_ascii" in part
    ]
    assert len(blocks) == 3
    for block in blocks:
        (options,) = yaml.safe_load(block).values()
        SerialAscii(SerialAscii.Options.model_validate(options))


@pytest.mark.parametrize(
    ("out", "written"),
    [
        ("#01%0<sum8>", "write '84'"),
        ("#01%01<sum8>", "write '61'"),
        (r"M1\r%<xor8>", r"write '\x71'"),
        ("50%%", "write a single %"),
        ("M%(a)", "write the characters themselves"),
    ],
)
def test_a_converter_in_a_request_is_noticed(out: str, written: str) -> None:
    """0x23 + 0x30 + 0x31 = 0x84; M, 1 and CR: 0x4D ^ 0x31 ^ 0x0D = 0x71."""
    for options in ({"out": out, "in": "%f"}, {"out": "", "requests": [{"out": out, "in": "%f"}]}):
        with pytest.raises(ValidationError, match="is sent as it stands") as caught:
            gauge(**options)
        assert written in str(caught.value)


def test_a_percent_sign_in_a_request_is_sent() -> None:
    gauge(**{"out": "%0102", "in": "%f"})


@pytest.mark.parametrize("word", ["F%*6c", "ERR%d", "%%", "%*[E]"])
def test_a_pattern_in_place_of_a_number_is_noticed(word: str) -> None:
    with pytest.raises(ValidationError, match="its words are literal, not patterns"):
        gauge(**{"in": "%+08.3f", "channels": [{**CHANNEL, "instead": {word: "sensor_fault"}}]})


def test_a_percent_sign_in_place_of_a_number_is_literal() -> None:
    device = gauge(**{"in": "%+08.3f", "channels": [{**CHANNEL, "instead": {"% % ": "sensor_fault"}}]})
    (reading,) = poll(device, b"% % \r\n")
    assert reading.quality is Quality.SENSOR_FAULT
