"""Rows that are left out from a program: the sidecar says why, and keeps what people wrote into it."""

from __future__ import annotations

import pytest

from compd.errors import RecordingError
from compd.recording.exclusions import exclude_rows, include_rows, rows_of_text, rows_text
from compd.recording.reader import read_recording
from tests.support.command import run_in_process
from tests.support.measured import gauges, record

HAND_WRITTEN = """\
# the big hall, doors open
excluded_rows:
- {row: 17, reason: 'the tracker''s beam was cut'}
- rows: 20-22  # a lorry went by
  reason: vibration
"""


@pytest.fixture
def path(tmp_path):
    path = record(tmp_path, gauges(60, 1), [])
    sidecar = path.with_suffix(".yaml")
    sidecar.write_text(sidecar.read_text() + HAND_WRITTEN)
    return path


def excluded(path):
    return dict(read_recording(path).sidecar.excluded)


def test_rows_are_left_out_with_their_reason_and_comments_stay(path):
    before = path.with_suffix(".yaml").read_text()
    exclude_rows(path, [30, 31, 40], "fog: 100 % humid")
    text = path.with_suffix(".yaml").read_text()
    assert "# the big hall, doors open" in text
    assert "# a lorry went by" in text
    assert text.startswith(before.partition("# the big hall")[0])
    new = dict.fromkeys((30, 31, 40), "fog: 100 % humid")
    old = {17: "the tracker's beam was cut", **dict.fromkeys((20, 21, 22), "vibration")}
    assert excluded(path) == old | new


def test_rows_count_again_and_others_of_their_entry_do_not(path):
    include_rows(path, [21, 17])
    assert excluded(path) == {20: "vibration", 22: "vibration"}
    include_rows(path, [20, 22])
    assert excluded(path) == {}
    assert "excluded_rows" not in path.with_suffix(".yaml").read_text()


def test_a_row_gets_the_new_reason(path):
    exclude_rows(path, [21], "a thunderstorm")
    assert excluded(path)[21] == "a thunderstorm"
    assert excluded(path)[20] == "vibration"


@pytest.mark.parametrize(("rows", "reason", "words"), [([5], "  ", "reason"), ([], "fog", "needs a row")])
def test_rows_and_a_reason_are_needed(path, rows, reason, words):
    before = path.with_suffix(".yaml").read_bytes()
    with pytest.raises(RecordingError, match=words):
        exclude_rows(path, rows, reason)
    assert path.with_suffix(".yaml").read_bytes() == before


def test_rows_in_few_words():
    assert rows_text([3, 2, 9, 4]) == "2-4,9"
    assert rows_of_text("9,2-4", "--rows") == [2, 3, 4, 9]
    for text in ("", "1", "5-3", "x", "2-", "-4"):
        with pytest.raises(RecordingError, match="--rows: names no rows"):
            rows_of_text(text, "--rows")


def test_by_command(path):
    assert "left out: 3 rows, fog" in run_in_process(
        "recording", "exclude", str(path), "--rows", "30-31,40", "--reason", "fog"
    )
    assert excluded(path)[31] == "fog"
    assert "1 rows count again" in run_in_process("recording", "include", str(path), "--rows", "31")
    assert 31 not in excluded(path)
