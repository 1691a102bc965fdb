"""Every order, from the button to the daemon: its consequence first, refused unless armed, then done for good."""

from __future__ import annotations

import re

import pytest

from compd.client import connect
from compd.errors import DaemonError
from tests.support.live_models import file_with
from tests.support.live_page import opened, until
from tests.support.patience import PATIENCE_S

pytestmark = pytest.mark.long

# Where the computer has too much to do, a gauge may be late just when zero is taken; a person tries again, too.
TRIES = 5
LATE = re.compile("stale|moved while")
SCALES = ("scale_1.position", "scale_2.position", "scale_3.position")


@pytest.fixture
def daemon(live):
    """A client of the daemon; afterwards it has no models."""
    with connect(live.socket, timeout_s=PATIENCE_S) as client:
        yield client
        client.model("")
        client.model("", shadow=True)


@pytest.fixture
def back_afterwards(tab, live, daemon):
    """Afterwards every line is whole, every gauge is believed, and the machine stands at its machine zero."""
    scale_mm = live.machine.ask("TRUTH")["scale_mm"][0]
    yield
    live.machine.ask("FAULT", line="scale_2", fault=None)
    live.machine.ask("DRIVE", scale_mm=[scale_mm] * 3)
    until_standing(tab, live)
    until(tab, f"{gauge(SCALES[1])} && [undefined, 'distrusted'].includes({gauge(SCALES[1])}.fault)")
    daemon.accept("all")
    takes_zero(tab, daemon)


@pytest.fixture
def model(live):
    live.recordings.mkdir(exist_ok=True)
    return file_with(live.recordings / "warm.model.yaml", "link_expansion", link_expansion=10.0)


def gauge(name):
    return f"compd.live.gauges?.[compd.machine.wiring.findIndex((wire) => wire.channel === '{name}')]"


def shows(name, value_mm):
    return f"Math.abs({gauge(name)}?.value - {value_mm}) < 0.05"


def until_standing(tab, live):
    while live.machine.ask("TRUTH")["moving"]:
        tab.wait_for_timeout(20)


def drive(tab, live, daemon, length_mm, scales):
    """Drive every link there, and wait until the machine stands and these scales show it.

    Of a scale that was asked too late a motion may look impossible: it is accepted.
    """
    live.machine.ask("DRIVE", scale_mm=[length_mm] * 3)
    until_standing(tab, live)
    for name in scales:
        until(tab, f"{gauge(name)}?.fault === 'distrusted' || {shows(name, length_mm)}")
        if name in distrusted(daemon):
            daemon.accept(name)
        until(tab, shows(name, length_mm))


def takes_zero(tab, daemon):
    for tries_left in reversed(range(TRIES)):
        until(tab, "document.body.dataset.state === 'ok'")
        try:
            daemon.zero(replace=True)
            return
        except DaemonError as error:
            if not (LATE.search(str(error)) and tries_left):
                raise


def order_answer(tab):
    until(tab, "!['', '…'].includes(document.querySelector('.order-answer').textContent)")
    return tab.locator(".order-answer").inner_text()


def asked(tab, order, numbers=""):
    """What the page says that an order will do, with these numbers; asked again while there is no valid setpoint."""
    if not tab.locator("#drawer").is_visible():
        tab.keyboard.press("o")
    for _ in range(TRIES):
        if numbers:
            until(tab, "compd.live.setpoint?.valid")
        with tab.expect_response(lambda answer: f"/orders/{order}" in answer.url):
            tab.locator(f"#order-{order}").click()
        tab.wait_for_selector("#confirm")
        text = tab.locator(".consequence").inner_text()
        if re.search(numbers, text):
            return text
    raise AssertionError(text)


def arm(tab):
    tab.locator("#arm").click()
    until(tab, "document.getElementById('role').classList.contains('armed')")


def refuses_unless_armed(tab, order, subject=""):
    """The page tells to arm; the server refuses whoever asks it directly."""
    tab.locator("#confirm").click()
    assert "Arm the page first" in order_answer(tab)
    answer = tab.evaluate(
        "([order, subject]) => fetch(`orders/${order}`,"
        " {method: 'POST', body: JSON.stringify({id: compd.id, subject})})"
        ".then(async (response) => [response.status, await response.json()])",
        [order, subject],
    )
    assert answer[0] == 403
    assert answer[1]["reason"] == "this browser is not armed"


def arm_from_keyboard(tab):
    tab.keyboard.press("o")
    arm(tab)


def given(tab, order):
    """The second step, once armed; the answer to it, or to the next try where a gauge was late."""
    for tries_left in reversed(range(TRIES)):
        tab.locator("#confirm").click()
        answer = order_answer(tab)
        if not (LATE.search(answer) and tries_left):
            return answer
        until(tab, "document.body.dataset.state === 'ok'")
        asked(tab, order)
    raise AssertionError


def choose(tab, file):
    tab.keyboard.press("o")
    tab.locator("#drawer input[aria-label^='Model file']").fill(file.name)


@pytest.mark.sample
def test_zero(tab, live, daemon):
    before = daemon.status()["zero"]["taken_at"]
    text = asked(tab, "zero")
    assert "21 gauges" in text
    assert f"The zero of {before} is kept" in text
    assert f"compd zero --daemon {live.socket}" in tab.locator(".consequence code").inner_text()
    refuses_unless_armed(tab, "zero")
    assert daemon.status()["zero"]["taken_at"] == before
    arm(tab)
    assert given(tab, "zero") == "Done: take machine zero."
    assert daemon.status()["zero"]["taken_at"] > before


def test_a_zero_that_is_elsewhere_is_taken_when_a_person_says_that_it_is_meant(tab, live, daemon, back_afterwards):
    before = daemon.status()["zero"]["taken_at"]
    drive(tab, live, daemon, 0.7, SCALES)
    asked(tab, "zero")
    arm(tab)
    for _ in range(TRIES):
        answer = given(tab, "zero")
        assert "0.5 mm" in answer
        assert "scale_1" in answer
        assert daemon.status()["zero"]["taken_at"] == before
        assert f"compd zero --daemon {live.socket} --yes" in tab.locator(".consequence code").inner_text()
        tab.locator(".consequence button", has_text="It is the zero position").click()
        answer = order_answer(tab)
        if not LATE.search(answer):
            break
        asked(tab, "zero")
    assert answer == "Done: take machine zero."
    assert daemon.status()["zero"]["taken_at"] > before
    until(tab, shows(SCALES[0], 0.0))


@pytest.mark.parametrize("by", ["order", "row"])
def test_accept(tab, live, daemon, back_afterwards, by):
    """A scale that was away while its link moved is not believed, until a person says so: all of them, or this one."""
    live.machine.ask("FAULT", line="scale_2", fault="unplugged")
    until(tab, f"{gauge(SCALES[1])}?.fault")
    drive(tab, live, daemon, 0.3, (SCALES[0], SCALES[2]))
    live.machine.ask("FAULT", line="scale_2", fault=None)
    until(tab, "compd.slow.status?.gauges.some((gauge) => gauge.quality === 'distrusted')")
    if by == "order":
        text = asked(tab, "accept")
    else:
        tab.locator("#gauge-table tr.bad button").first.click()
        tab.wait_for_selector("#confirm")
        text = tab.locator(".consequence").inner_text()
    assert re.search(r"scale 2.*0\.3\d* mm", text), text
    subject = "all" if by == "order" else "scale_2.position"
    assert f"compd accept {subject} --daemon {live.socket}" in text
    refuses_unless_armed(tab, "accept", subject)
    assert distrusted(daemon) == ["scale_2.position"]
    arm(tab)
    answer = given(tab, "accept")
    assert re.fullmatch(r"Done: accept gauges\. scale_2\.position: believed for [01]\.\d s\.", answer), answer
    until(tab, f"{gauge(SCALES[1])} && !{gauge(SCALES[1])}.fault")
    assert distrusted(daemon) == []


def distrusted(daemon):
    return [gauge["channel"] for gauge in daemon.status()["gauges"] if gauge["quality"] == "distrusted"]


def test_shadow(tab, live, daemon, model):
    choose(tab, model)
    assert "nothing of it reaches the machine" in asked(tab, "shadow")
    assert f"compd model shadow {model} --daemon {live.socket}" in tab.locator(".consequence code").inner_text()
    refuses_unless_armed(tab, "shadow", str(model))
    assert "shadow" not in daemon.model()
    arm(tab)
    assert given(tab, "shadow") == "Done: run as a shadow."
    model = daemon.model()
    assert model["shadow"]["effects"] == ["link_expansion"]
    assert model["applied"]["effects"] == []
    until(tab, "document.querySelector('.strip small').textContent.includes('shadow')")


@pytest.mark.sample
def test_adopt(tab, live, daemon, model):
    daemon.model(str(model), shadow=True)
    until(tab, "compd.live.setpoint?.shadow?.correction_mm && compd.slow.status.model.shadow")
    choose(tab, model)
    asked(tab, "adopt", r"changes by [+-]\d+\.\d µm at link [123].*slews for \d+\.\d s")
    refuses_unless_armed(tab, "adopt", str(model))
    assert daemon.model()["applied"]["effects"] == []
    arm(tab)
    assert given(tab, "adopt") == "Done: adopt the shadow's model."
    assert "not kept over a restart" in tab.locator(".consequence").inner_text()
    assert tab.locator(".consequence code").inner_text() == f"model_file: {model}"
    assert daemon.model()["applied"]["effects"] == ["link_expansion"]
    until(tab, "document.querySelector('#budget .legend').textContent.includes('link expansion')")


@pytest.mark.sample
@pytest.mark.parametrize("named", ["", "another"])
def test_only_the_model_whose_change_was_told_is_adopted(tab, live, daemon, model, named):
    """Another file is refused, and so is none, which would be to run without effects."""
    other = file_with(live.recordings / "other.model.yaml", "link_expansion", link_expansion=90.0)
    daemon.model(str(model), shadow=True)
    until(tab, "compd.live.setpoint?.shadow?.correction_mm && compd.slow.status.model.shadow")
    arm_from_keyboard(tab)
    answer = tab.evaluate(
        "(subject) => fetch('orders/adopt', {method: 'POST', body: JSON.stringify({id: compd.id, subject})})"
        ".then(async (response) => [response.status, await response.json()])",
        str(other) if named else "",
    )
    assert answer[0] == 409
    assert daemon.model()["applied"]["effects"] == []
    assert daemon.model()["shadow"]["file"] == str(model)


def test_no_model(tab, live, daemon, model):
    daemon.model(str(model))
    until(tab, "compd.live.setpoint?.sources_mm?.link_expansion")
    text = asked(tab, "no-model", r"changes by [+-]\d+\.\d µm at link [123]")
    assert f"compd model adopt --none --daemon {live.socket}" in text
    refuses_unless_armed(tab, "no-model")
    assert daemon.model()["applied"]["effects"] == ["link_expansion"]
    arm(tab)
    assert given(tab, "no-model") == "Done: run without effects."
    assert daemon.model()["applied"]["effects"] == []
    until(tab, "!document.querySelector('#budget .legend').textContent.includes('link expansion')")


@pytest.mark.sample
def test_arming_ends_with_the_connection(tab, chromium, live):
    with opened(chromium, live) as other:
        other.keyboard.press("o")
        arm(other)
        until(tab, "document.getElementById('connected').textContent.includes('armed')")
        id = other.evaluate("compd.id")
    until(tab, "!document.getElementById('connected').textContent.includes('armed')")
    for path in ("arm", "orders/zero"):
        answer = tab.evaluate(
            "([path, id]) => fetch(path, {method: 'POST', body: JSON.stringify({id})}).then((answer) => answer.status)",
            [path, id],
        )
        assert answer == 403


@pytest.mark.sample
def test_disarming_ends_it_at_once(tab):
    tab.keyboard.press("o")
    arm(tab)
    tab.locator("#arm").click()
    until(tab, "!document.getElementById('role').classList.contains('armed')")
    asked(tab, "zero")
    refuses_unless_armed(tab, "zero")
