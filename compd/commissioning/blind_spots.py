"""Undetected faults: faults that look like a good machine, the checks that show some of them, and their cost.

`BLIND_SPOTS` is the one list, for `compd check --what-cannot-be-seen` and for the documentation; `fault_costs` has the
numbers of one machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from compd.commissioning.fault_costs import (
    Figures,
    departure,
    drift,
    exchanged,
    gap,
    late,
    lost_parameters,
    lost_periods,
    nothing,
    power_cut,
    scatter,
    small_jump,
    stuck_comparator,
    stuck_scale,
    wrong_thermometer,
)
from compd.configuration import Configuration
from compd.live.machine import RESTED
from compd.stated_noise import SCATTER_RATIO


@dataclass(frozen=True)
class BlindSpot:
    """One kind of fault."""

    name: str  #: stable, for programs
    fault: str  #: what happens
    shown_by: str  #: what shows it, and under which condition; "" if nothing does
    vote: str  #: the key under `votes:` (`VoteSettings`) for this; "" if it needs none, or there is none
    unseen: str  #: what remains that nothing shows
    cost: Callable[[Figures], str]  #: its number for a machine; "" if it has none there


def shown_by(spot: BlindSpot, configuration: Configuration | None = None) -> str:
    """Checks that show a fault, in words: with the vote for it, and whether that is on in this configuration."""
    if not spot.vote:
        return spot.shown_by or "nothing"
    state = ""
    if configuration is not None:
        setting = getattr(configuration.votes, spot.vote)
        state = " is on" if setting is not None and setting is not False else " is off"
    return f"{spot.shown_by} (`votes.{spot.vote}`{state})"


BLIND_SPOTS: tuple[BlindSpot, ...] = (
    BlindSpot(
        "drift_of_a_scale",
        "a scale drifts: its head comes loose, its mount grows warm",
        "in machine-tool mode, once it exceeds the following error",
        "following_mm",
        "in CMM mode, and where the drive itself follows this scale",
        lambda figures: drift(figures, "scale"),
    ),
    BlindSpot(
        "drift_of_a_joint_comparator",
        "a joint comparator drifts, or its probe comes loose",
        "of a revolute joint with two: the two no longer go together",
        "joint_pair_um",
        "of a joint with one comparator, or where both drift alike",
        lambda figures: drift(figures, "joint"),
    ),
    BlindSpot(
        "drift_of_a_frame_comparator",
        "a frame comparator drifts, or its rod grows warm",
        "where frame temperatures are wired: the frame moves more than they explain",
        "frame",
        "slow drifts that a temperature could explain",
        lambda figures: drift(figures, "frame"),
    ),
    BlindSpot(
        "stuck_comparator",
        "a comparator shows one value for ever: its probe hangs, its unit repeats itself",
        "where its noise exceeds its last digit: bit-identical readings while its neighbours scatter",
        "repeated_digits",
        "where noise or digits are coarse, and until enough readings have come",
        stuck_comparator,
    ),
    BlindSpot(
        "stuck_scale",
        "a scale shows one value for ever",
        "while the machine moves: the other links, or its own joints, say so",
        "standing_scale_mm",
        "with the machine at rest; and what moved before the vote was sure",
        stuck_scale,
    ),
    BlindSpot(
        "exchanged_gauges",
        "the cables of two gauges are exchanged, or their ports in the configuration",
        "while they are plugged: each came back with another value, or jumped; in the configuration: the lasting names "
        "of their ports are kept with their last readings and with machine zero",
        "",
        "where both show the same at that moment; and where they were exchanged when machine zero was taken",
        exchanged,
    ),
    BlindSpot(
        "one_poll_late",
        "a device answers each time with the reading before, or averages",
        "where it can be asked two different things in turn: an answer to the wrong one",
        "",
        "nothing shows a display that is late by itself; at rest it does no harm",
        late,
    ),
    BlindSpot(
        "departure_from_rest",
        "the machine leaves after a rest",
        "the next reading of its scales; after a short rest, `u_tip_um` allows for it",
        "",
        f"a machine that has rested for {RESTED:g} times as long as its readings are old is taken to rest until then",
        departure,
    ),
    BlindSpot(
        "small_jump",
        "a reading jumps by less than what its acceleration and noise allow",
        "a larger jump: `acceleration_mm_per_s2` of the gauge",
        "",
        "jumps up to that size",
        small_jump,
    ),
    BlindSpot(
        "lost_signal_periods",
        "a scale's interpolator loses signal periods, or quarters of them",
        "at rest, while all other lengths stand: two steps or more within an hour that come to a signal period; in "
        "machine-tool mode one step, while its setpoint stands",
        "signal_periods",
        "one step in CMM mode, for which there is a warning; steps of less than a quarter; all that are lost in motion",
        lost_periods,
    ),
    BlindSpot(
        "scatter",
        "the readings of a length scatter more than its noise: hum, a bad contact, coarse digits",
        f"a warning, where the scatter at rest is over {SCATTER_RATIO:g} times `noise_um`, or less than "
        f"1 / {SCATTER_RATIO:g} of it",
        "",
        "less than that; what comes in motion alone; hum that the polls alias to less than three periods a second; "
        "coarser digits, while the machine stands",
        scatter,
    ),
    BlindSpot(
        "gauge_that_runs_away",
        "a reading runs away as smoothly as the machine could move",
        "in CMM mode: the tip would be faster than the machine ever is",
        "tip_mm_per_s",
        "in machine-tool mode, and whatever is slower",
        lambda figures: f"1 mm of a scale is {figures.leverage('scale'):.2f} mm at the tip",
    ),
    BlindSpot(
        "wrong_thermometer",
        "a thermometer that an effect reads is wrong: its wire, its module or its place has changed",
        "beyond its range, faster than heat changes anything, or far from most other thermometers "
        "(`plausible`, `fastest_change`, `apart` of the quantity); or the same digits while all others change",
        "standing_temperature_K",
        "what is slower and nearer than that, or nearer when the daemon starts; several alike; one that falls off its "
        "part into air as warm",
        wrong_thermometer,
    ),
    BlindSpot(
        "power_cut",
        "displays and computer lose their power together; the displays count anew from where they stand",
        "a gauge that counts must show what it showed last, which is on the disk, and a person looks whether the "
        "machine stands where it stood",
        "",
        "a person who accepts without a look; a state directory that was lost",
        power_cut,
    ),
    BlindSpot(
        "display_parameters_at_zero",
        "a scale's display loses its direction or its unit while it shows zero",
        "at any other place: it comes back with another value. At zero a person is asked for, after the computer or "
        "the scale was off",
        "",
        "a person who accepts without a look; a gauge with `absolute` or `trust_after_loss`; comparators, which move "
        "by hundredths of a mm",
        lost_parameters,
    ),
    BlindSpot(
        "count_lost_in_a_gap",
        "a gauge loses its count while its replies are lost, or it is not read",
        "at rest: it shows another value, and no other scale has moved. On the move: its limits of motion, and the "
        "ways of the other links where they say how far it went; after more than its `restart_s` without an answer a "
        "person is asked for",
        "",
        "on the move, what its limits of motion allow in a gap of the daemon itself, or where the other links say "
        "nothing",
        gap,
    ),
    BlindSpot(
        "wrong_from_the_start",
        "a sign, a link or a channel is wired wrongly, or machine zero was taken at another place",
        "`compd compare` with a reference instrument; `compd zero` says by how much it differs from the one before",
        "",
        "the daemon alone cannot: at machine zero every wiring shows no change",
        nothing,
    ),
    BlindSpot(
        "not_measured",
        "what no gauge measures moves: the tool, the plate, a link between scale and joint, the platform",
        "`compd diagnose`, from a recording with a reference instrument",
        "",
        "everything that is not between two ends of a gauge, beyond what the model's effects say",
        nothing,
    ),
)
