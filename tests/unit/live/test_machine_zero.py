"""Machine zero: taken at rest from good gauges only, kept whole on disk, refused for another machine."""

from __future__ import annotations

import errno
import json
import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from compd.configuration import load
from compd.errors import StateError
from compd.files import checksum_of
from compd.gauge import Quality, bad, good
from compd.live.loop.commands import Commands
from compd.live.machine.machine_zero import FILE_NAME, OLD_FILE_NAME, MachineZero, load_zero, withdraw_zero
from compd.live.machine.wiring import MachineWires
from compd.live.memory.latest import Latest
from compd.live.service.zero_capture import REST_TOLERANCE_MM, ZeroCapture
from compd.live.system import THIS_COMPUTER, System
from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S

CONFIG = ROOT / "config" / "tripod-cmm.yaml"
ZERO = MachineZero("abc", "2026-01-01T00:00:00+00:00", {"a.1": 1.25, "b.1": -0.1})


def test_what_is_saved_is_what_is_loaded(tmp_path):
    path = ZERO.save(tmp_path / "state", THIS_COMPUTER)
    assert path == tmp_path / "state" / FILE_NAME
    assert load_zero(tmp_path / "state", "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO
    assert [p.name for p in path.parent.iterdir()] == [FILE_NAME], "no temporary file stays"


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (None, "never been taken"),
        ("", "not JSON"),
        ('{"format": 1, "zero_hash": "abc"', "not JSON"),
        ("[]", "not a machine zero"),
        ('{"format": 4, "zero_hash": "abc", "taken_at": "", "readings_mm": {}}', "a later release of compd"),
        ('{"zero_hash": "abc", "taken_at": "", "readings_mm": {}}', "format: is not a machine zero: Field required"),
        ('{"format": 1, "zero_hash": 7, "taken_at": "", "readings_mm": {}}', "zero_hash: is not a machine zero"),
        (
            '{"format": 1, "zero_hash": "abc", "taken_at": "", "readings_mm": {"a.1": true}}',
            "a.1: is not a machine zero",
        ),
        (
            '{"format": 1, "zero_hash": "abc", "taken_at": "", "readings_mm": {"a.1": "1"}}',
            "a.1: is not a machine zero",
        ),
        ('{"format": 1, "zero_hash": "abc", "taken_at": "", "readings_mm": {"a.1": NaN}}', "not a machine zero"),
        ('{"format": 1, "zero_hash": "abc", "taken_at": "", "readings_mm": {"a.1": null}}', "not a machine zero"),
        ('{"format": 1, "zero_hash": "abc", "taken_at": "", "readings_mm": {"a.1": 1}}', "lacks b.1"),
        ('{"format": 1, "zero_hash": "xyz", "taken_at": "", "readings_mm": {"a.1": 1, "b.1": 2}}', "another geometry"),
    ],
)
def test_a_zero_that_is_not_whole_or_not_this_machines_is_refused(tmp_path, content, says):
    if content is not None:
        (tmp_path / FILE_NAME).write_text(content)
    with pytest.raises(StateError, match=says):
        load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER)


def test_a_crash_while_writing_leaves_the_old_zero(tmp_path, monkeypatch):
    ZERO.save(tmp_path, THIS_COMPUTER)

    def power_cut(descriptor):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", power_cut)
    with pytest.raises(StateError, match="cannot be written: Input/output error"):
        replace(ZERO, readings_mm={"a.1": 9.0, "b.1": 9.0}).save(tmp_path, THIS_COMPUTER)
    monkeypatch.undo()
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO


def test_the_disk_has_the_content_before_the_name_and_then_the_name(tmp_path, monkeypatch):
    order = []
    sync, rename = os.fsync, Path.replace

    def fsync(descriptor):
        order.append("directory" if Path(f"/proc/self/fd/{descriptor}").is_dir() else "file")
        sync(descriptor)

    def replace_(self, target):
        order.append("rename")
        return rename(self, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "replace", replace_)
    ZERO.save(tmp_path, THIS_COMPUTER)
    assert order == ["file", "rename", "directory"]


def test_the_hash_is_of_geometry_gauges_and_wiring_only():
    configuration = load(CONFIG)
    ports = {name: line.model_copy(update={"timeout_s": 9.0}) for name, line in configuration.lines.items()}
    assert replace(configuration, lines=ports).zero_hash == configuration.zero_hash
    first, *others = configuration.wiring.scale
    flipped = first.model_copy(update={"sign": -first.sign})
    rewired = configuration.wiring.model_copy(update={"scale": (flipped, *others)})
    assert replace(configuration, wiring=rewired).zero_hash != configuration.zero_hash


class Taking(System):
    """A zero being taken: the clock moves only when the taker waits, and the gauges are read each time."""

    def __init__(self, directory):
        configuration = load(CONFIG)
        gauges = configuration.gauge_objects()
        self.latest = Latest([f"{name}.{c.name}" for name, gauge in gauges.items() for c in gauge.channels])
        self.wires = MachineWires(configuration, self.latest)
        self.commands = Commands(StateError.of("zero", "none"))
        self.now_s = 50.0
        self.reads = 0
        self.value_mm = lambda channel, read: 3.0 + 0.001 * (-1) ** read
        self.quality = lambda channel, read: Quality.OK
        self.answers = []
        self.accepted = []
        self.taker = ZeroCapture(
            self.wires, self.latest, self.commands, directory, configuration.zero_hash, self, self.accept
        )
        self._read()

    def monotonic(self):
        return self.now_s

    def wait(self, event, timeout_s):
        self.now_s += timeout_s
        self._read()
        return event.is_set()

    def _read(self):
        self.reads += 1
        for channel in self.wires.length_channels:
            quality = self.quality(channel, self.reads)
            reading = good(self.value_mm(channel, self.reads), self.now_s)
            self.latest.put(self.latest.index[channel], reading if quality is Quality.OK else bad(self.now_s, quality))

    def accept(self, gauge):
        self.accepted.append(gauge)

    def take(self, replace=False):
        self.taker.start(replace, self.answers.append)
        self.taker._job.join()
        return json.loads(self.answers[-1])


def test_zero_is_the_mean_of_every_gauge_saved_and_then_adopted(tmp_path):
    taking = Taking(tmp_path)
    answer = taking.take()
    assert answer["class"] == "ZERO"
    assert taking.reads > 10
    assert isinstance(taking.commands.zero, MachineZero)
    assert set(taking.commands.zero.readings_mm) == set(taking.wires.length_channels)
    assert taking.commands.zero.readings_mm["joints.4"] == pytest.approx(3.0, abs=1e-4)
    assert (
        load_zero(tmp_path, taking.commands.zero.zero_hash, taking.wires.length_channels, THIS_COMPUTER)
        == taking.commands.zero
    )


def test_a_reading_seen_twice_counts_once(tmp_path):
    taking = Taking(tmp_path)
    taking.value_mm = lambda channel, read: 1.0 if read == 1 else 1.004
    taking._read = lambda: None  # no gauge delivers again, one reading is all there is
    taking.reads = 1
    assert taking.take()["class"] == "ERROR", "and it is stale before the window ends"


@pytest.mark.parametrize("quality", [Quality.TIMEOUT, Quality.CRC, Quality.NEVER_READ, Quality.SENSOR_FAULT])
@pytest.mark.parametrize("channel", ["scale_2.position", "joints.9", "cabinet.t1"])
def test_a_zero_with_a_gauge_that_is_not_good_is_refused_and_nothing_changes(tmp_path, channel, quality):
    taking = Taking(tmp_path)
    before = taking.commands.zero
    taking.quality = lambda name, read: quality if name == channel and read == 20 else Quality.OK
    answer = taking.take()
    assert (answer["class"], answer["code"]) == ("ERROR", "zero_refused")
    assert channel in answer["text"]
    assert quality in answer["text"]
    assert taking.commands.zero is before
    assert not (tmp_path / FILE_NAME).exists()


def test_a_machine_that_moves_has_no_zero(tmp_path):
    taking = Taking(tmp_path)
    taking.value_mm = lambda channel, read: read * 2 * REST_TOLERANCE_MM if channel == "scale_1.position" else 0.0
    answer = taking.take()
    assert answer["code"] == "zero_refused"
    assert "scale_1.position moved" in answer["text"]


def test_a_disk_that_refuses_is_told_and_the_old_zero_stays(tmp_path):
    directory = tmp_path / "state"
    directory.write_text("a file where the directory should be")
    taking = Taking(directory)
    before = taking.commands.zero
    answer = taking.take()
    assert answer["code"] == "zero_refused"
    assert "cannot be written" in answer["text"]
    assert taking.commands.zero is before


def test_a_digit_that_was_changed_by_hand_is_refused(tmp_path):
    path = ZERO.save(tmp_path, THIS_COMPUTER)
    path.write_text(path.read_text().replace("1.25", "1.26"))
    with pytest.raises(StateError, match="changed after it was written"):
        load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER)
    content = json.loads(path.read_text())
    del content["checksum"]
    path.write_text(json.dumps(content))
    with pytest.raises(StateError, match="no checksum"):
        load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER)


def test_a_file_of_an_earlier_release_has_no_checksum_and_is_used(tmp_path):
    (tmp_path / FILE_NAME).write_text(json.dumps({"format": 1, **ZERO.to_json()}))
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO


def test_the_file_keeps_the_ports_and_a_recording_does_not(tmp_path):
    zero = replace(ZERO, ports={"a": "/dev/serial/by-id/usb-one", "b": "192.168.10.20:502:1"})
    path = zero.save(tmp_path, THIS_COMPUTER)
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == zero
    assert "ports" not in zero.to_json()
    path.write_text(path.read_text().replace("usb-one", "usb-two"))
    with pytest.raises(StateError, match="changed after it was written"):
        load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER)


def test_a_file_without_ports_is_used(tmp_path):
    (tmp_path / FILE_NAME).write_text(
        json.dumps({"format": 2, **ZERO.to_json(), "checksum": checksum_of(ZERO.to_json())})
    )
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda path: path.write_text("[" * 100_000), "not JSON"),
        (lambda path: path.write_text('{"a":' * 100_000), "not JSON"),
        (os.mkfifo, "it is not a regular file"),
        (lambda path: path.symlink_to("/dev/zero"), "it is not a regular file"),
        (lambda path: path.write_bytes(b"\xff\xfe"), "not JSON"),
        (lambda path: path.write_text(" " * 1_000_001), "more than 1000000 bytes"),
    ],
)
def test_a_file_that_is_none_is_an_error_and_neither_hangs_nor_fills_the_memory(tmp_path, make, says):
    make(tmp_path / FILE_NAME)
    with pytest.raises(StateError, match=says):
        load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER)


def test_the_zero_before_is_kept_beside_the_new_one(tmp_path):
    first = ZERO.save(tmp_path, THIS_COMPUTER).read_bytes()
    later = replace(ZERO, taken_at="2026-01-02T00:00:00+00:00")
    second = later.save(tmp_path, THIS_COMPUTER).read_bytes()
    assert (tmp_path / OLD_FILE_NAME).read_bytes() == first
    ZERO.save(tmp_path, THIS_COMPUTER)
    assert (tmp_path / OLD_FILE_NAME).read_bytes() == second
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO


def test_a_full_disk_leaves_both_files_as_they_were_and_no_other(tmp_path, monkeypatch):
    ZERO.save(tmp_path, THIS_COMPUTER)
    replace(ZERO, taken_at="2026-01-02T00:00:00+00:00").save(tmp_path, THIS_COMPUTER)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StateError, match="No space left"):
        ZERO.save(tmp_path, THIS_COMPUTER)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_zero_far_from_the_one_before_needs_to_be_confirmed(tmp_path):
    taking = Taking(tmp_path)
    first = taking.take()
    assert "changed_mm" not in first, "there was none before"
    taking.value_mm = lambda channel, read: 8.0 if channel == "scale_1.position" else 3.0
    taking._read()
    refused = taking.take()
    assert (refused["class"], refused["code"]) == ("ERROR", "zero_differs")
    assert "scale_1.position +5.0000 mm" in refused["text"]
    assert taking.commands.zero.readings_mm["scale_1.position"] == pytest.approx(3.0, abs=1e-3)
    assert not (tmp_path / OLD_FILE_NAME).exists()
    accepted = list(taking.accepted)
    assert accepted == [wire.channel for wire in taking.wires.length_wires], "by the first alone; quantities are not"
    taken = taking.take(replace=True)
    assert taken["changed_mm"]["scale_1.position"] == pytest.approx(5.0, abs=1e-3)
    assert taken["changed_mm"]["joints.1"] == pytest.approx(0.0, abs=1e-3)
    assert taking.accepted == accepted * 2
    taking.value_mm = lambda channel, read: 8.4 if channel == "scale_1.position" else 3.0
    taking._read()
    assert taking.take()["class"] == "ZERO", "0.4 mm is not asked about"


def test_a_gauge_that_is_not_believed_is_accepted_only_where_that_is_confirmed(tmp_path):
    """It came back 5 mm away: with the machine zero until now, its readings would be wrong by as much."""
    taking = Taking(tmp_path)
    taking.take()
    before = taking.commands.zero
    taking.accepted.clear()
    zeros_at_acceptance = []

    def accept(gauge):
        taking.accepted.append(gauge)
        zeros_at_acceptance.append(taking.commands.zero)
        taking.quality = lambda channel, read: Quality.OK

    taking.taker._accept = accept
    taking.quality = lambda channel, read: Quality.DISTRUSTED if channel == "scale_1.position" else Quality.OK
    taking.value_mm = lambda channel, read: 8.0 if channel == "scale_1.position" else 3.0
    taking._read()
    refused = taking.take()
    assert refused["code"] == "zero_differs"
    assert "not believed: scale_1.position" in refused["text"]
    assert taking.commands.zero is before
    assert taking.accepted == []
    taken = taking.take(replace=True)
    assert taken["class"] == "ZERO"
    assert isinstance(zeros_at_acceptance[0], StateError), "no zero while it is believed and the old zero is wrong"
    assert taking.commands.zero.readings_mm["scale_1.position"] == pytest.approx(8.0)


def test_a_gauge_that_was_accepted_for_a_zero_that_is_then_refused_leaves_no_zero(tmp_path):
    taking = Taking(tmp_path)
    taking.take()
    taking.quality = lambda channel, read: Quality.DISTRUSTED if channel == "scale_1.position" else Quality.OK
    taking._read()

    def accept(gauge):
        taking.quality = lambda channel, read: Quality.OK
        taking.value_mm = lambda channel, read: read * 1.0  # it moves

    taking.taker._accept = accept
    assert taking.take(replace=True)["code"] == "zero_refused"
    assert isinstance(taking.commands.zero, StateError)
    assert "compd zero" in str(taking.commands.zero)
    with pytest.raises(StateError, match="withdrawn"):  # nor after a restart
        load_zero(tmp_path, taking.taker._zero_hash, (), THIS_COMPUTER)


def test_whatever_goes_wrong_is_answered(tmp_path, monkeypatch):
    taking = Taking(tmp_path)
    monkeypatch.setattr(MachineZero, "save", lambda *_: 1 / 0)
    assert taking.take()["code"] == "zero_refused"


def test_the_end_does_not_wait_for_a_disk_that_hangs(tmp_path, monkeypatch):
    taking = Taking(tmp_path)
    saving, disk = threading.Event(), threading.Event()

    def write_files(contents):
        saving.set()
        disk.wait()

    monkeypatch.setattr(taking, "write_files", write_files)
    monkeypatch.setattr("compd.live.service.zero_capture._END_WITHIN_S", 0.01)
    taking.taker.start(False, taking.answers.append)
    assert saving.wait(PATIENCE_S)
    taking.taker.stop()
    assert taking.answers == []
    disk.set()
    assert taking.taker._job.join(PATIENCE_S)


def test_a_daemon_that_starts_while_zero_is_taken_anew_does_not_use_the_one_before(tmp_path):
    path = ZERO.save(tmp_path, THIS_COMPUTER)
    before = path.read_bytes()
    withdraw_zero(tmp_path, THIS_COMPUTER)
    with pytest.raises(StateError, match=f"was withdrawn to take it anew; it is in {OLD_FILE_NAME}"):
        load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER)
    withdraw_zero(tmp_path, THIS_COMPUTER)  # there is none
    assert (tmp_path / OLD_FILE_NAME).read_bytes() == before
    ZERO.save(tmp_path, THIS_COMPUTER)
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO
    assert (tmp_path / OLD_FILE_NAME).read_bytes() == before


def test_a_zero_that_the_disk_keeps_is_not_taken_anew(tmp_path):
    class ReadOnly(System):
        def rename(self, path, new):
            raise OSError(errno.EROFS, "Read-only file system")

    ZERO.save(tmp_path, THIS_COMPUTER)
    with pytest.raises(StateError, match="cannot be replaced: Read-only file system"):
        withdraw_zero(tmp_path, ReadOnly())
    assert load_zero(tmp_path, "abc", ("a.1", "b.1"), THIS_COMPUTER) == ZERO
