"""Write the pages of docs/reference from the code: `make reference`."""

from __future__ import annotations

from pathlib import Path

from compd.live.loop.states import State

REFERENCE = Path(__file__).parent / "reference"


def states() -> str:
    """The page of the states of a setpoint."""
    rows = [f"| `{state}` | {'yes' if state.valid else 'no'} | {state.code} | {state.text} |" for state in State]
    return "\n".join(
        [
            "# States of a setpoint",
            "",
            "Made by `make reference` from `compd/live/loop/states.py`. `code` is the number in the UDP packet.",
            "A reader that meets a state or a code which it does not know must take the setpoint for invalid: later",
            "releases may add some.",
            "",
            "| state | valid | code | meaning |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )


# By file name.
PAGES = {"states.md": states}


def main() -> None:
    """Write every page."""
    REFERENCE.mkdir(exist_ok=True)
    for name, page in PAGES.items():
        (REFERENCE / name).write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
