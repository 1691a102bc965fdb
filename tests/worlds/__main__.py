"""Worlds from seeds: `python -m tests.worlds --seed 1`."""

from tests.worlds.command import main

if __name__ == "__main__":
    raise SystemExit(main())
