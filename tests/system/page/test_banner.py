"""The banner: the worst state of the last seconds, what a person does about it, and lengths without powers of ten."""

from __future__ import annotations

import pytest


def imported(tab, module, body, given=None):
    return tab.evaluate(f"async (given) => {{ const from = await import('/static/{module}'); {body} }}", given)


def test_a_length_is_in_um_below_a_millimetre_and_in_mm_above(tab):
    texts = {
        153_700.0: "154 mm",
        2782.0: "2.78 mm",
        999.6: "1 mm",
        999.4: "999 µm",
        -1234.0: "\N{MINUS SIGN}1.23 mm",
        0.166: "0.166 µm",
        0.0: "0 µm",
        12_345_678.0: "12300 mm",
        None: "\N{EN DASH}",
    }
    shown = imported(tab, "format.js", "return given.map((um) => from.lengthText(um ?? NaN))", [*texts])
    assert dict(zip(texts, shown, strict=True)) == texts


def test_amounts_have_one_unit_unless_one_is_a_millimetre(tab):
    texts = {
        "1.01 → 1.15 µm": [[1.01, 1.15], "um"],
        "154 mm → 12 µm": [[153_700.0, 12.0], "um"],
        "\N{EN DASH} µm": [[None], "um"],
        "2000.00 arcsec": [[2000.0], "arcsec"],
    }
    body = "return given.map((amounts) => from.amounts(...amounts))"
    assert imported(tab, "format.js", body, [*texts.values()]) == [*texts]


@pytest.mark.parametrize(
    ("told", "worst"),
    [
        (["ok", "hold", "ok"], ["hold", 1]),
        (["hold", "refused", "hold", "refused", "hold"], ["refused", 2]),
        (["stop", "unheard_of", "fault"], ["unheard_of", 1]),
        (["ok", "ok", "ok"], ["ok", 1]),
    ],
)
def test_the_worst_state_of_the_last_seconds_stays_with_its_count(tab, told, worst):
    body = """
      let now_s = 0;
      const latch = new from.Latch(() => now_s);
      for (const state of given) {
        now_s += 0.1;
        latch.note({ state, reason: `because ${state}` });
      }
      const { state, count, reason } = latch.worst;
      now_s += 2.9;
      latch.note({ state: 'ok', reason: '' });
      const kept = latch.worst.state;
      now_s += 0.2 * given.length;
      latch.note({ state: 'ok', reason: '' });
      return [state, count, reason, kept, latch.worst.state];"""
    state, count = worst
    found = imported(tab, "latch.js", body, told)
    assert found[:3] == [state, count, f"because {state}"]
    assert found[4] == "ok"


GAUGES = [{"kind": "scale", "channel": "scale_1.position"}, {"kind": "joint", "channel": "joints.4"}]


@pytest.mark.parametrize(
    ("gauges", "says", "order"),
    [
        ([{"fault": "line_lost"}, {}], "by itself when every gauge is good", None),
        ([{"fault": "line_lost", "needs_person": True}, {}], "a person looks at scale_1, references it", None),
        ([{"fault": "timeout"}, {"fault": "distrusted"}], "a person looks at joints, references it", None),
        ([{"fault": "distrusted", "needs_person": True}, {}], "Look at scale_1, reference it", "accept"),
    ],
)
@pytest.mark.parametrize("state", ["hold", "stop"])
def test_what_is_lost_while_the_machine_drives_waits_for_a_person(tab, gauges, says, order, state):
    page = {"machine": {"wiring": GAUGES}, "live": {"gauges": gauges}}
    summary = {"tone": "care", "name": state.upper(), "state": state}
    remedy = imported(tab, "remedy.js", "return from.remedyOf(...given)", [page, summary])
    assert says in remedy["text"]
    assert ("by itself when" in remedy["text"]) == (says.startswith("by itself"))
    assert remedy.get("order") == order
