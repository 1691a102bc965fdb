"""Model files that would take all memory or never come to an end."""

from __future__ import annotations

import pytest

from compd.errors import StateError
from compd.live import loop_succession
from compd.live.loop_succession import LoopSuccession
from compd.live.memory.control import Control
from compd.live.processes.loop_process import ModelChange
from compd.live.system import THIS_COMPUTER
from compd.model_file.model_document import read_document


def aliases(levels):
    lines = [f"a0: &a0 [{', '.join(['1'] * 9)}]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, levels)]
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[" * 4000, "more than 50 levels"),
        ("a: " + "{b: " * 4000, "more than 50 levels"),
        ("- " * 4000 + "1", "more than 50 levels"),
        (aliases(9), "aliases unfolded"),
        ("x: &x [*x]", "recursive alias"),
        ("\0", "cannot stand in YAML"),
        ("\udcff", "is not in UTF-8"),
    ],
    ids=["brackets", "mappings", "dashes", "bomb", "loop", "null", "latin"],
)
def test_a_text_that_would_take_all_memory_or_end_the_parser_is_one_problem(tmp_path, text, says):
    path = tmp_path / "m.yaml"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(StateError, match=says) as caught:
        read_document(path)
    assert len(str(caught.value)) < 500


def test_a_loop_that_is_never_ready_with_its_model_is_ended_and_the_request_answered(monkeypatch):
    """An effect of a user's own that loops for ever."""
    monkeypatch.setattr(loop_succession, "READY_WITHIN_S", 0.0)
    control = Control()

    class Endless:
        def __init__(self):
            self.control = control

        def run_successor(self, number, change):
            while True:
                pass

        def answer(self, *answer):
            control.model_answer.write(answer)

    loops = LoopSuccession(Endless(), THIS_COMPUTER, None)
    loops.start_successor(ModelChange(4, None, False))
    while control.model_answer.read() is None:
        loops.end_late_successor(THIS_COMPUTER.monotonic())
        loops.collect(4)
    number, summary, refusal = control.model_answer.read()
    assert (number, summary) == (4, None)
    assert "not ready within" in refusal
    assert not loops.has_successor
    control.close()
