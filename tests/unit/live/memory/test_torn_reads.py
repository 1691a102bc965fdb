"""Another process writes as fast as it can, and is killed in the middle: nothing that is read is ever a mixture."""

from __future__ import annotations

import itertools
import math
import os

import pytest

from compd.gauge import Quality, Reading, bad, good
from compd.live.memory.latest import Latest
from compd.live.memory.readings import Readings, pack
from compd.live.memory.shared_message import SharedRecord
from compd.live.memory.shared_ring import ENTRIES, RingReader, SharedRing
from tests.support.other_process import beside

READS = 20_000


def contents():
    """Contents of very different lengths, each of one byte only."""
    for number in itertools.count():
        yield bytes([number % 251]) * (1 + (number * 7919) % 4000)


def test_a_record_is_read_whole_while_it_is_written():
    record = SharedRecord(8000)
    source = contents()
    seen = set()
    with beside(lambda: record.write(next(source))):
        for number in itertools.count():
            content = record.read()
            if content:
                assert content == content[:1] * len(content)
                seen.add(content[0])
            if number > READS and len(seen) > 50:  # it was written all the time
                break


def test_a_record_whose_writer_was_killed_can_be_written_again():
    for _ in range(20):
        record = SharedRecord(2_000_000)
        with beside(lambda record=record: record.write(bytes(2_000_000))):
            while not record.version:
                pass
        assert record.read() in (None, bytes(2_000_000))
        record.write(b"new")
        assert record.read() == b"new"


def test_a_record_says_what_does_not_fit():
    with pytest.raises(ValueError, match="11 bytes, at most 10"):
        SharedRecord(10).write(bytes(11))
    assert SharedRecord(10).read() == b""


def test_readings_that_belong_together_are_never_of_two_rounds():
    names = [f"j{k}.v" for k in range(9)]
    latest = Latest(["a.x", *names], [names])
    numbers = itertools.count(1)

    def write():
        number = next(numbers)
        latest.put(0, good(float(-number), float(number)))
        latest.put_all({index: good(float(number), float(number)) for index in range(1, 10)})

    rounds = set()
    with beside(write):
        for number in itertools.count():
            together = latest.snapshot(1.0).readings[1:]
            assert len({reading.value for reading in together if reading.ok}) <= 1
            assert len({reading.ok for reading in together}) == 1
            rounds.add(together[0].value)
            if number > READS and len(rounds) > 100:
                break


def test_readings_that_belong_together_come_again_after_their_writer_was_killed():
    latest = Latest(["a.v", "b.v"], [["a.v", "b.v"]])
    latest.put_all({0: good(1.0, 1.0), 1: good(1.0, 1.0)})
    latest.snapshot(1.0)
    latest._versions[1] |= 1  # killed while it published
    latest.put(0, good(2.0, 2.0))
    assert [reading.value for reading in latest.snapshot(2.0).readings] == [1.0, 1.0]
    latest.put_all({0: good(3.0, 3.0), 1: good(3.0, 3.0)})
    assert [reading.value for reading in latest.snapshot(3.0).readings] == [3.0, 3.0]


def test_readings_are_never_mixed_from_two():
    latest = Latest(["a.x", "a.y"])
    numbers = itertools.count(1)

    def write():
        number = next(numbers)
        latest.put(0, Reading(float(number), float(number), Quality.TIMEOUT, str(number) * 8))
        latest.put(1, Reading(float(-number), float(number), Quality.OK))

    newest = 0.0
    with beside(write):
        for number in itertools.count():
            if number > READS and newest > 100:
                break
            readings = latest.snapshot(1.0).readings
            first, second = Readings.checked(readings.image)
            if first.quality is Quality.TIMEOUT:
                assert first.detail == str(int(first.value)) * 8
                assert first.value == first.time_s >= newest, "and none is older than the one before"
                newest = first.value
            if second.ok:
                assert second.value == -second.time_s


def test_a_slot_that_stays_half_written_keeps_the_reading_before():
    latest = Latest(["a.x"])
    latest.put(0, good(1.0, 5.0))
    assert latest.snapshot(6.0).readings[0] == good(1.0, 5.0)
    latest._versions[0] += 1  # as a writer leaves it that is killed before its last step
    assert latest.snapshot(7.0).readings[0] == good(1.0, 5.0)
    latest.put(0, good(2.0, 8.0))
    assert latest.snapshot(9.0).readings[0] == good(2.0, 8.0)


def test_a_slot_whose_checksum_does_not_fit_keeps_the_reading_before():
    latest = Latest(["a.x", "a.y"])
    latest.put(0, good(1.0, 5.0))
    latest.snapshot(6.0)
    latest.put(0, good(2.0, 6.5))
    latest._slots[0] ^= 1  # its version says that it is whole
    latest.put(1, good(3.0, 6.5))
    readings = latest.snapshot(7.0).readings
    assert (readings[0], readings[1]) == (good(1.0, 5.0), good(3.0, 6.5))


@pytest.mark.parametrize(
    "reading",
    [
        good(0.1 + 0.2, 12345.678901234567),
        bad(1.0, Quality.DEVICE_ERROR, "ER,MS,31"),
        bad(1.0, Quality.DRIVER_ERROR, "ü" * 500),
        bad(1.0, Quality.MISMATCH, "\ud800 half a pair"),
    ],
)
def test_a_reading_comes_back_bit_for_bit_and_a_long_detail_is_cut(reading):
    content = pack(reading)
    (back,) = Readings.checked(content)
    assert back.time_s == reading.time_s
    assert back.quality is reading.quality
    assert back.value == reading.value or math.isnan(back.value)
    assert reading.detail.encode(errors="replace").decode().startswith(back.detail)
    for place in (0, 9, 16, 20):
        damaged = bytearray(content)
        damaged[place] ^= 1
        with pytest.raises(ValueError, match="damaged"):
            Readings.checked(bytes(damaged))


def test_a_reader_of_the_ring_gets_whole_entries_in_their_order():
    ring = SharedRing()
    numbers = itertools.count()

    def write():
        number = next(numbers)
        ring.put(float(number), number % 3, str(number).encode() * 50)

    reader, last = RingReader(ring), -1
    with beside(write):
        while last < 20 * ENTRIES:  # the writer goes round and round
            for content in reader.contents(lambda time_s, state: True):
                number = int(content[: len(content) // 50])
                assert content == str(number).encode() * 50
                assert number > last
                last = number
    assert last + 1 <= ring.count
    ring.close()


def test_an_entry_that_is_overwritten_or_too_long_is_refused():
    ring = SharedRing()
    for number in range(ENTRIES + 1):
        ring.put(float(number), 1, b"x")
    assert ring.get(0) is None
    assert ring.get(1) == b"x"
    assert ring.when(1) == (1.0, 1)
    assert ring.get(ENTRIES + 1) is None, "not yet written"
    with pytest.raises(ValueError, match="at most"):
        ring.put(0.0, 1, bytes(ring.longest_content + 1))
    ring.close()


def test_the_ring_wakes_its_reader_for_what_is_due_and_for_a_new_state():
    ring = SharedRing()
    ring.put(1.0, 2, b"")
    woken = [ring_has_woken(ring)]
    ring.put(2.0, 2, b"")
    woken.append(ring_has_woken(ring))
    ring.put(3.0, 5, b"")
    woken.append(ring_has_woken(ring))
    ring.wake_from(4.0)
    ring.put(3.9, 5, b"")
    woken.append(ring_has_woken(ring))
    ring.put(4.0, 5, b"")
    woken.append(ring_has_woken(ring))
    assert woken == [True, False, True, False, True]
    ring.close()


def ring_has_woken(ring):
    try:
        return os.eventfd_read(ring.woken) > 0
    except BlockingIOError:
        return False


def test_a_ring_has_room_for_the_readings_of_a_large_machine():
    ring = SharedRing(channels=500)
    ring.put(1.0, 1, bytes(200 * 500 * 4))
    assert ring.get(0) == bytes(200 * 500 * 4)
    ring.close()
