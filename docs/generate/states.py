"""The page of the states of a setpoint."""

from __future__ import annotations

from compd.setpoint_states import State


def page() -> str:
    """Markdown, from the table of states."""
    rows = [
        f"| `{state}` | {state.code}, {'valid' if state.valid else 'invalid'} | {state.text} | {state.left} |"
        for state in State
    ]
    return "\n".join(
        [
            "# States of a setpoint",
            "",
            "`code` is the number in the UDP packet. A reader that meets a state or a code that it does not know must",
            "treat the setpoint as invalid, because later releases may add some.",
            "",
            "| state | code | meaning | how it is left |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )
