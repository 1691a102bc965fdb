"""The table of states: what is part of the protocol does not move, and its readers follow it."""

from __future__ import annotations

import pytest

from compd.cli.live.watch import state_colour, view
from compd.setpoint_states import State, state_named
from docs.generate.states import page

CODES = ["starting", "no_zero", "ok", "slewing", "clamped", "hold", "fade", "stop", "refused", "degraded", "fault"]
VALID = {"ok", "slewing", "clamped", "hold", "fade", "degraded"}


def test_names_codes_and_validity_are_part_of_the_protocol_and_do_not_move():
    assert [(state.value, state.code) for state in State][: len(CODES)] == [(name, k) for k, name in enumerate(CODES)]
    assert {state.value for state in State if state.valid} >= VALID
    assert not any(state.valid for state in State if state.value in set(CODES) - VALID)


def test_no_code_is_used_twice_and_each_fits_in_a_byte():
    codes = [state.code for state in State]
    assert len(set(codes)) == len(codes)
    assert all(0 <= code < 256 for code in codes)


def test_invalid_states_rank_above_valid_ones_and_ok_below_all():
    assert min(state.rank for state in State if not state.valid) > max(state.rank for state in State if state.valid)
    assert all(state.rank > State.OK.rank for state in State if state is not State.OK)
    assert State.CLAMPED.rank > State.HOLD.rank == State.FADE.rank > State.SLEWING.rank


def test_the_reference_names_every_state():
    assert all(f"| `{state}` |" in page() for state in State)


def test_a_state_is_found_by_its_name_and_an_unknown_one_is_none():
    assert all(state_named(state.value) is state for state in State)
    assert state_named("of_tomorrow") is None


@pytest.mark.parametrize(("name", "colour"), [("ok", "green"), ("hold", "yellow"), ("stop", "red"), ("new", "red")])
def test_watch_colours_by_validity_and_takes_an_unknown_state_for_invalid(name, colour):
    assert state_colour(name) == colour


def test_watch_shows_no_values_of_a_state_that_it_does_not_know():
    version = {"machine": "m"}
    setpoint = {"state": "of_tomorrow", "reason": "why", "valid": True, "mode": "cmm", "seq": 1}
    status = {"loop": {"rate_hz": 200, "missed_cycles": 0}, "gauges": []}
    assert len(view(version, setpoint, status).renderables) == 3, "headline, reason and loop"


def test_watch_shows_processes_only_where_one_has_ended():
    setpoint = {"state": "stop", "reason": "", "valid": False, "mode": "cmm", "seq": 1}
    status = {"loop": {"rate_hz": 200, "missed_cycles": 0}, "gauges": []}
    well = {"loop": {"pid": 2, "starts": 2}, "service": {"pid": 3, "starts": 1}}  # another model was adopted
    assert len(view({"machine": "m"}, setpoint, status | {"processes": well}).renderables) == 2, "headline and loop"
    ended = well | {"line dial": {"pid": 5, "starts": 3, "last_end": "killed by SIGSEGV"}}
    *_, shown = view({"machine": "m"}, setpoint, status | {"processes": ended}).renderables
    assert shown.plain == "started anew: line dial, start 3, the one before: killed by SIGSEGV"
