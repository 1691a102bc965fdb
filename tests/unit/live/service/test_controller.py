"""Who is the controller, for how long, and how the role is taken away."""

from __future__ import annotations

from contextlib import closing

from compd.live.service.request_context import TargetKeys
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


TARGET = {"class": "TARGET", "tip_B0_mm": [1, 2, 3]}


def test_a_target_may_be_used_for_a_time_and_a_repeated_one_for_longer(tmp_path):
    with closing(Service(tmp_path, target={"valid_for_s": 0.5})) as service:
        controller = service.tcp()
        sent_s = service.clock.monotonic()
        controller.send(TARGET)
        controller.ask({"class": "STATUS"})
        first_s = service.commands.target.valid_until_s
        assert sent_s <= first_s - 0.5 <= service.clock.monotonic()
        service.pass_time(10)
        controller.send(TARGET)
        controller.ask({"class": "STATUS"})
        assert service.commands.target.valid_until_s >= first_s + 10, "the same target, sent again"
        service.pass_time(3600)
        assert controller.ask({"class": "STATUS"})
        assert service.commands.target is not None, "a target that is too old does not end the role: not silently cmm"


def test_the_role_is_taken_over_the_unix_socket_and_not_taken_back(service):
    controller, owner = service.tcp(), service.unix()
    controller.send(TARGET)
    controller.ask({"class": "STATUS"})
    assert owner.ask({"class": "RELEASE"}) == {"class": "RELEASE"}
    assert service.commands.target is None
    answer = controller.ask(TARGET)
    assert answer["code"] == "role_taken"
    assert "connect again" in answer["text"]
    assert service.commands.target is None
    owner.send(TARGET)
    owner.ask({"class": "STATUS"})
    assert service.commands.target is not None
    assert owner.ask({"class": "RELEASE"}) == {"class": "RELEASE"}
    assert owner.ask({"class": "RELEASE"})["code"] == "not_controller", "nobody has it"
    again = service.tcp()
    again.send(TARGET)
    again.ask({"class": "STATUS"})
    assert service.commands.target is not None, "a new connection may"


def test_targets_may_be_for_the_unix_socket_alone(tmp_path):
    with closing(Service(tmp_path, target={"unix_only": True})) as service:
        answer = service.tcp().ask(TARGET)
        assert (answer["code"], service.commands.target) == ("unix_only", None)
        owner = service.unix()
        owner.send(TARGET)
        owner.ask({"class": "STATUS"})
        assert service.commands.target is not None
