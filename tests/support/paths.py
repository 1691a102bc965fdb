"""Where things are."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
TESTS = ROOT / "tests"
# Vectors and example recordings; tests that need them skip where it is absent.
SHARED = ROOT.parent / "shared"
VECTORS = SHARED / "vectors"
RECORDINGS = SHARED / "recordings"
