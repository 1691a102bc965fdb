"""The wheel that `make wheel` has installed in a bare environment: nothing but what it asks for is beside it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from compd.extras import EXTRAS, install_line
from tests.support.paths import ROOT

ENVIRONMENT = ROOT / "build" / "wheel-test"
RECORDING = ROOT / "tests" / "guard" / "files-0.2" / "campaign.csv"
# Installed size (MB) with all dependencies: 500 of numpy, scipy, numba and LLVM, and what a surprise would add.
LARGEST_MB = 560
pytestmark = pytest.mark.skipif(not (ENVIRONMENT / "bin" / "compd").exists(), reason="`make wheel` has not been run")


def compd(directory: Path, *arguments: str) -> tuple[str, str]:
    """What the installed command prints on both outputs, run outside of the checkout."""
    command = [str(ENVIRONMENT / "bin" / "compd"), *arguments]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def packages() -> Path:
    (directory,) = (ENVIRONMENT / "lib").glob("python*/site-packages")
    return directory


def test_no_package_of_an_extra_is_there() -> None:
    assert [name for names in EXTRAS.values() for name in names if (packages() / name).exists()] == []


def test_it_is_no_larger_than_its_dependencies() -> None:
    size_mb = sum(path.lstat().st_size for path in packages().rglob("*") if path.is_file()) / 1e6
    assert size_mb < LARGEST_MB


def test_a_first_check_and_a_first_comparison_compile_nothing(tmp_path: Path) -> None:
    machine = packages() / "compd" / "shipped_config" / "tripod-cmm.yaml"
    assert compd(tmp_path, "check", str(machine))[1] == ""
    shown, said = compd(tmp_path, "compare", str(RECORDING), "--machine", str(machine))
    assert "noise floor" in shown
    assert "compiles" not in said
    assert not list((packages() / "compd" / "__pycache__").glob("kernels-*/**/*.nbi"))


@pytest.mark.parametrize("page", ["protocol", "configuration", "recording", "effects"])
def test_the_reference_is_in_it(tmp_path: Path, page: str) -> None:
    path = Path(compd(tmp_path, "docs", f"reference/{page}", "--path")[0].strip())
    assert path.is_file()
    assert path.is_relative_to(packages())


def test_the_demo_runs_and_says_what_the_pictures_need(tmp_path: Path) -> None:
    shown, said = compd(tmp_path, "demo", "--seconds", "15")
    assert "with joints and frame compensated" in " ".join(shown.split())
    assert install_line("report") in shown
    assert "compiles" not in said
