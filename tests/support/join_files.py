"""A campaign taken apart, as the join wizard finds it: recordings of gauges, and exports of its instrument."""

from __future__ import annotations

from pathlib import Path

from compd.simulation import simulate_campaign
from tests.support.instrument_files import split_campaign, write_export

# Recordings of the gauges: as a machine records them, and with the ids of the places.
GAUGES, GAUGES_WITH_PLACES = "gauges-1", "gauges-2"
TRACK, GERMAN_TRACK, POINTS = "track-csv.csv", "track-german.csv", "points-csv.csv"


def write_join_files(directory: Path, recordings: Path) -> None:
    """Recordings of gauges in `recordings`, exports in `recordings/exports`; the campaign in `directory`."""
    exports = recordings / "exports"
    exports.mkdir(parents=True)
    campaign = directory / "campaign.csv"
    simulate_campaign("tripod-cmm", campaign, seed=5)
    moving = split_campaign(campaign, recordings / f"{GAUGES}.csv")
    write_export(exports, "csv", moving.track(sessions=(1,)), stem="track")
    write_export(exports, "german", moving.track(sessions=(1,)), stem="track")
    at_rest = split_campaign(campaign, recordings / f"{GAUGES_WITH_PLACES}.csv", keep=("session", "point", "visit"))
    write_export(exports, "csv", at_rest.points(), stem="points")
