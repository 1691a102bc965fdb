"""Recordings: one at a time, whoever asks, and downloaded as a zip file."""

from __future__ import annotations

import asyncio
import io
import zipfile

from compd.page.recordings import Recordings


def test_of_two_that_ask_at_once_one_records(tmp_path):
    recordings = Recordings(tmp_path, "/no/socket")

    async def both():
        answer = await asyncio.gather(recordings.start("a", None), recordings.start("b", None))
        await recordings.stop()
        return answer

    assert asyncio.run(both()) == ["", "a is being recorded already"]


def test_a_part_is_downloaded_with_what_belongs_to_it_in_pieces(tmp_path):
    for name in ("day-1.csv", "day-1.yaml", "day-10.csv", "day.csv"):
        (tmp_path / name).write_text(name * 100_000)
    recordings = Recordings(tmp_path, "/no/socket")
    pieces = recordings.archive("day-1")
    assert pieces is not None
    with zipfile.ZipFile(io.BytesIO(b"".join(pieces))) as archive:
        assert archive.namelist() == ["day-1.csv", "day-1.yaml"]
        assert archive.read("day-1.yaml") == b"day-1.yaml" * 100_000
    assert recordings.archive("day-2") is None
    assert recordings.archive("../day") is None


def test_a_download_has_what_belongs_to_the_recording_and_never_the_sealed_answer(tmp_path):
    own = ["run.csv", "run.cycles.jsonl", "run.model-0a1b2c.yaml", "run.yaml"]
    for name in (*own, "run.answer.json", "run.key", "run.model.yaml.py", "run.py", "run.csv.old", "run.secret.yaml"):
        (tmp_path / name).write_text(name)
    (tmp_path / "run.model-ffff.yaml").symlink_to("/etc/hostname")
    pieces = Recordings(tmp_path, "/no/socket").archive("run")
    assert pieces is not None
    with zipfile.ZipFile(io.BytesIO(b"".join(pieces))) as archive:
        assert archive.namelist() == own


def test_a_recording_is_listed_once_whatever_its_tables(tmp_path):
    for name in ("day.csv", "day.parquet", "day.yaml", "night.parquet", "late-0001.arrow"):
        (tmp_path / name).write_text(name)
    recordings = Recordings(tmp_path, "/no/socket")
    assert sorted((part["name"], part["bytes"]) for part in recordings.listed()) == [("day", 7), ("night", 13)]
    assert recordings.archive("night") is not None
    assert asyncio.run(recordings.start("late", None)) == "late is there already"
