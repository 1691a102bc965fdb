"""Who is the controller, for how long, and how the role is taken away."""

from __future__ import annotations

from contextlib import closing

from compd.live.service.request import TargetKeys
from tests.support.service import Service


def test_the_first_client_with_a_target_is_the_controller_until_it_releases(service):
    first, second = service.tcp(), service.unix()
    target = {"class": "TARGET", "tip_B0_mm": [1, 2.5, -510]}
    first.send(target)
    assert first.ask({"class": "STATUS"})["class"] == "STATUS"
    assert service.commands.target is not None
    assert service.commands.target.tip_mm == (1.0, 2.5, -510.0)
    assert second.ask(target)["code"] == "role_taken"
    assert service.tcp().ask({"class": "RELEASE"})["code"] == "not_controller"
    assert first.ask({"class": "RELEASE"}) == {"class": "RELEASE"}
    assert service.commands.target is None
    second.send(target)
    second.ask({"class": "STATUS"})
    assert service.commands.target is not None


def test_a_controller_that_goes_leaves_cmm_mode_behind(service):
    first, second = service.tcp(), service.tcp()
    first.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})
    first.ask({"class": "STATUS"})
    assert service.commands.target is not None
    first.close()
    # the publisher sees the end of that stream no later than it answers the newcomer after it
    second.ask({"class": "STATUS"})
    service.tcp().ask({"class": "STATUS"})
    assert service.commands.target is None


def test_a_hexapod_and_a_tool_on_the_plate_take_their_own_targets(tmp_path):
    with closing(Service(tmp_path / "h", TargetKeys("tip_B0_mm", rotation=True))) as hexapod:
        peer = hexapod.unix()
        peer.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3], "rotation_B0_rad": [0, 0.1, 0]})
        peer.ask({"class": "STATUS"})
        assert hexapod.commands.target is not None
        assert hexapod.commands.target.rotation_B0_rad == (0.0, 0.1, 0.0)
    with closing(Service(tmp_path / "p", TargetKeys("tip_P_mm", rotation=False))) as plate:
        peer = plate.unix()
        assert peer.ask({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})["code"] == "bad_message"
        peer.send({"class": "TARGET", "tip_P_mm": [1, 2, 3]})
        peer.ask({"class": "STATUS"})
        assert plate.commands.target is not None
