"""A simulated campaign taken apart: a recording of the gauges alone, and what an instrument of its own frame and clock
would have exported, in every shape.

    split = split_campaign(tmp_path / "first.csv", tmp_path / "gauges.csv")
    track = write_export(tmp_path, "sa", split.track())
    points = write_export(tmp_path, "german", split.points(), stem="points")

Joining `split.gauges` and the export must give the campaign's reference back, but for `split.to_instrument`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.instruments import Samples, instrument_formats, written_forms
from compd.instruments.samples import LENGTH, POSITION
from compd.units import UM_PER_MM

# The recording's clock is ahead of the instrument's by this.
OFFSET_S = 137.25
START = datetime(2026, 11, 22, 9, 15, 30)
RATE_HZ = 4.0
# Noise of one sample beside that of the row, which is in the campaign's reference already.
SAMPLE_NOISE_UM = 0.02
# At rest around a row for so long, to either side; less where the next row is near, none below MIN_DWELL_S.
DWELL_S, MIN_DWELL_S = 1.5, 0.3
# Between rows further apart nobody measured: the night between two sessions.
NIGHT_S = 600.0
ENDINGS = {form.name: declared.ending for declared in instrument_formats().values() for form in declared.written}


@dataclass(frozen=True)
class SplitCampaign:
    """A campaign with its reference taken off.

    Attributes
    ----------
    gauges : the recording of gauges alone. time_s : (N,) of its rows.
    values : (N, d) the reference in {M}, mm, or a length, nan where only the gauges were read. axes : of it.
    session : (N,) from 1. place : (N,) number of the nominal target; -1 in motion.
    rotation, shift_mm : instrument = rotation M + shift. offset_s : recording time = instrument time + offset_s.
    """

    gauges: Path
    time_s: FloatArray
    values: FloatArray
    axes: tuple[str, ...]
    session: IntArray
    place: IntArray
    rotation: Rotation
    shift_mm: FloatArray
    offset_s: float = OFFSET_S

    def to_instrument(self, values: FloatArray) -> FloatArray:
        """(N, d) in the instrument's frame; a length stays as it is."""
        if self.axes != POSITION:
            return values
        return np.asarray(self.rotation.apply(values) + self.shift_mm)

    def track(self, rate_hz: float = RATE_HZ, sessions: Sequence[int] = ()) -> Samples:
        """What the instrument saw, at a constant rate: at rest around each row, on straight ways between them.

        Without `sessions`, all of them; not measured in the nights between. Shapes without a time need one session.
        """
        kept = np.isfinite(self.values).all(axis=1)
        if sessions:
            kept &= np.isin(self.session, sessions)
        knots_s, knots = _knots(self.time_s[kept], self.values[kept], self.at_rest()[kept])
        begins = [0, *(np.flatnonzero(np.diff(knots_s) > NIGHT_S) + 1), len(knots_s)]
        times = [
            np.arange(np.ceil(part[0] * rate_hz), part[-1] * rate_hz) / rate_hz
            for part in (knots_s[a:b] for a, b in pairwise(begins))
        ]
        time_s = np.concatenate(times)
        seen = np.column_stack([np.interp(time_s, knots_s, column) for column in knots.T])
        seen = self.to_instrument(seen)
        rng = np.random.default_rng(7)
        seen += rng.normal(0.0, SAMPLE_NOISE_UM / UM_PER_MM, seen.shape)
        return Samples(self.axes, seen, time_s - self.offset_s, start=START)

    def points(self, names: str = "order") -> Samples:
        """One point per row at rest, without a time, in the order of the rows.

        names : "order": P1, P2 ...; "place": by the nominal target, P007, again at each visit; "" for none.
        """
        kept = np.isfinite(self.values).all(axis=1) & self.at_rest()
        numbers = self.place[kept] if names == "place" else np.arange(1, kept.sum() + 1)
        texts = [f"P{number:03d}" if names == "place" else f"P{number}" for number in numbers]
        return Samples(self.axes, self.to_instrument(self.values[kept]), names=texts if names else None)

    def at_rest(self) -> BoolArray:
        """(N,) whether the machine stood still in a row."""
        return self.place >= 0


def split_campaign(
    recording: Path, gauges: Path, link: int | None = None, keep: Sequence[str] = ("session",), seed: int = 3
) -> SplitCampaign:
    """Take the reference off a campaign's recording, and write the recording of gauges alone.

    link : for a campaign with interferometers, which of them measures. keep : of the columns session, point and visit,
    which a campaign knows and a live recording has not. To join points by order or name keep all three: a campaign has
    one row in a dwell, so that the scales cannot tell where the dwells are.
    """
    with recording.open(newline="") as file:
        header, *rows = list(csv.reader(file))
    columns = {name: np.array([float(row[k] or "nan") for row in rows]) for k, name in enumerate(header)}
    axes = POSITION if link is None else LENGTH
    names = [f"reference_{axis}_mm" for axis in axes] if link is None else [f"reference_link_{link}_mm"]
    dropped = {name for name in ("session", "point", "visit") if name not in keep}
    left = [k for k, name in enumerate(header) if not name.startswith("reference_") and name not in dropped]
    with gauges.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([[row[k] for k in left] for row in (header, *rows)])
    sidecar = re.sub(r"^reference:\n(?:[ ].*\n)+", "", recording.with_suffix(".yaml").read_text(), flags=re.MULTILINE)
    gauges.with_suffix(".yaml").write_text(sidecar)
    rng = np.random.default_rng(seed)
    return SplitCampaign(
        gauges=gauges,
        time_s=columns["time_s"],
        values=np.column_stack([columns[name] for name in names]),
        axes=axes,
        session=columns["session"].astype(np.int64),
        place=np.nan_to_num(columns["point"], nan=-1.0).astype(np.int64),
        rotation=Rotation.random(random_state=rng.integers(1 << 31)),
        shift_mm=np.array([1200.0, -300.0, 80.0]),
    )


def write_export(directory: Path, shape: str, samples: Samples, unit: str = "mm", stem: str = "export") -> Path:
    """Write the samples in a form of `written_forms()`; returns the file."""
    path = directory / f"{stem}-{shape}{ENDINGS[shape]}"
    path.write_bytes(written_forms()[shape].write(replace(samples, unit=unit)))
    return path


def _half_dwells(time_s: FloatArray, at_rest: BoolArray) -> FloatArray:
    """(N,) how long the machine rests before and after each row; 0 in motion, and where the next row is too near."""
    gaps = np.concatenate([[np.inf], np.diff(time_s), [np.inf]])
    half_s = np.minimum(DWELL_S, 0.3 * np.minimum(gaps[:-1], gaps[1:]))
    return np.where(at_rest & (half_s >= MIN_DWELL_S), half_s, 0.0)


def _knots(time_s: FloatArray, values: FloatArray, at_rest: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Times and places between which the machine moves straight."""
    half_s = _half_dwells(time_s, at_rest)
    rests = half_s > 0
    times = np.concatenate([time_s - half_s, (time_s + half_s)[rests]])
    order = np.argsort(times, kind="stable")
    return times[order], np.concatenate([values, values[rests]])[order]
