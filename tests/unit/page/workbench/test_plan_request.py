"""A plan as a browser asks for it: options of the command, and problems at their fields."""

from __future__ import annotations

import pytest

from compd.errors import CompdError
from compd.page.workbench.plan_request import field_of, read_request

KNOWN = ("link_elasticity", "joint_contact")
GOOD = {"rivals": list(KNOWN), "rows": 20}


def test_what_is_left_out_is_left_to_the_recording():
    asked = read_request(GOOD, KNOWN)
    assert asked.options() == ["--rivals", "link_elasticity,joint_contact", "--rows", "20"]
    assert asked.workspace_M_mm is None


def test_limits_are_options_with_all_their_digits():
    limits = {"workspace": [[-100, 100.5], [0, 1], [2, 3]], "force": 12.3456789012, "temperature": [18, 25], "speed": 5}
    asked = read_request({**GOOD, **limits, "limits": {"azimuth_deg": [-90, 90]}, "beside": ["joint_contact"]}, KNOWN)
    assert asked.options()[4:] == [
        "--beside", "joint_contact", "--workspace=-100,100.5,0,1,2,3", "--force", "12.3456789012", "--speed", "5",
        "--temperature=18,25", "--limit", "azimuth_deg=-90,90",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("keys", "field"),
    [
        ({"rivals": ["/tmp/mine.py:MINE", "joint_contact"]}, "rivals"),
        ({"rivals": "link_elasticity"}, "rivals"),
        ({"rivals": [3]}, "rivals"),
        ({"rivals": list(KNOWN) * 9}, "rivals"),
        ({"beside": ["\ud800"]}, "beside"),
        ({"rows": 1}, "rows"),
        ({"rows": 1e9}, "rows"),
        ({"rows": True}, "rows"),
        ({"rows": None}, "rows"),
        ({"force": "many"}, "force"),
        ({"force": float("nan")}, "force"),
        ({"force": 10**400}, "force"),
        ({"speed": True}, "speed"),
        ({"temperature": [20]}, "temperature"),
        ({"temperature": [20, None]}, "temperature"),
        ({"temperature": {"low": 20}}, "temperature"),
        ({"workspace": [[0, 1]]}, "workspace"),
        ({"workspace": [[0, 1], [0, 1], [0, float("inf")]]}, "workspace"),
        ({"limits": {"azimuth_deg": "wide"}}, "limit of azimuth_deg"),
        ({"limits": [1]}, ""),
    ],
)
def test_what_is_not_understood_is_told_at_its_field(keys, field):
    with pytest.raises(CompdError) as caught:
        read_request({**GOOD, **keys}, KNOWN)
    assert {field_of(problem) for problem in caught.value.problems} == {field}
