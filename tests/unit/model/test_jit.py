"""Where compiled kernels are kept: in a directory of their own version, or nowhere, and then they work as well."""

from __future__ import annotations

import os
import pty
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from compd import jit, kernel_target
from compd.compile_kernels import compile_for_levels, kernel_modules
from compd.kernel_target import LEVELS
from tests.support.paths import ROOT


@pytest.fixture
def sources(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the sources that jit.py takes for its own."""
    folder = tmp_path / "compd"
    shutil.copytree(Path(jit.__file__).parent, folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(jit, "__file__", str(folder / "jit.py"))
    monkeypatch.setattr(jit._config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    return folder


def _directory_at_start() -> str:
    """Where a process keeps its kernels that starts now: the hash of the sources is taken once."""
    jit.kernel_digest.cache_clear()
    return jit._cache_directory()


@pytest.fixture(autouse=True)
def _digest_of_these_sources() -> Iterator[None]:
    """The hash of a changed copy does not outlive its test."""
    yield
    jit.kernel_digest.cache_clear()


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [("model/kernels/solve_status.py", "= 100.0", "= 200.0"), ("linear.py", "1e12", "1e11")],
)
def test_a_changed_limit_or_helper_does_not_run_old_kernels(sources: Path, name: str, old: str, new: str) -> None:
    before = _directory_at_start()
    assert Path(before).parent == sources / "__pycache__"
    assert _directory_at_start() == before
    text = (sources / name).read_text()
    assert old in text
    (sources / name).write_text(text.replace(old, new))
    assert _directory_at_start() != before


def test_a_read_only_installation_keeps_them_with_the_user(sources: Path, tmp_path: Path) -> None:
    (sources / "__pycache__").write_text("a file where the directory would be, as unwritable as can be")
    assert Path(jit._cache_directory()).parent == tmp_path / "user" / "compd"
    (tmp_path / "user" / "compd").rename(tmp_path / "gone")
    (tmp_path / "user" / "compd").write_text("here too")
    assert jit._cache_directory() == ""


def test_a_directory_that_the_person_names_is_the_only_one(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jit._config, "CACHE_DIR", str(tmp_path / "named"))
    assert Path(jit._cache_directory()).parent == tmp_path / "named"
    assert str(tmp_path / "named") == jit._config.CACHE_DIR


def test_every_module_with_a_kernel_is_among_those_compiled_when_a_wheel_is_built() -> None:
    kernel = re.compile(r"^(@loop|@kernel|@helper|\w+ = kernel)\(?", re.MULTILINE)
    files = [path.relative_to(ROOT) for path in (ROOT / "compd").rglob("*.py") if kernel.search(path.read_text())]
    modules = {".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in files}
    assert len(modules) > 20
    assert modules <= set(kernel_modules())


_COMPUTE = """
import sys
import numpy as np
from compd.rotation import compose, rotation_matrix, rotation_vector
random = np.random.default_rng(1)
R = rotation_matrix(random.normal(size=(1000, 3)))
sys.stdout.buffer.write(R.tobytes() + rotation_vector(R).tobytes() + compose(R, R[::-1]).tobytes())
"""


_ROTATIONS = ("-c", _COMPUTE)
_ALL_KERNELS = ("-m", "tests.support.kernel_results")


def _computed(program: tuple[str, str], installation: Path, **environment: str) -> tuple[bytes, str]:
    """What the program prints in a new process that imports this installation, and what is said beside it."""
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    done = subprocess.run(
        [sys.executable, *program],
        env={
            **inherited,
            "PYTHONPATH": os.pathsep.join(map(str, (installation, ROOT, ROOT / "drivers"))),
            **environment,
        },
        cwd=installation,
        capture_output=True,
        check=True,
    )
    return done.stdout, done.stderr.decode()


def _copy_installation(place: Path) -> None:
    """A copy without what was compiled."""
    shutil.copytree(ROOT / "compd", place / "compd", ignore=shutil.ignore_patterns("__pycache__", jit.BUILT))


@pytest.mark.parametrize("level", [*LEVELS])
def test_built_kernels_run_elsewhere_and_give_what_a_new_compilation_gives(tmp_path: Path, level: str) -> None:
    target = {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": ""}
    here, there = tmp_path / "here", tmp_path / "there"
    for place in (here, there):
        _copy_installation(place)
    # times differ: they are those of the copies
    for file in there.rglob("*.py"):
        os.utime(file, (1e9, 1e9))
    compiled, said = _computed(_ROTATIONS, here, NUMBA_CACHE_DIR=str(there / "compd" / jit.BUILT), **target)
    assert said.count("\n") == 1
    assert re.match(rf"compd compiles kernels \(about 1 min\): none fit py.*-numba.*-llvm.*-{level}; kept in ", said)
    unwritable = tmp_path / "file"
    unwritable.write_text("")
    assert _computed(_ROTATIONS, there, NUMBA_CACHE_DIR=str(unwritable), **target) == (compiled, "")
    # another change of the sources: nothing fits, and that is said
    changed = there / "compd" / "linear.py"
    changed.write_text(changed.read_text() + "# changed\n")
    again, said = _computed(_ROTATIONS, there, NUMBA_CACHE_DIR=str(tmp_path / "fresh"), **target)
    assert again == compiled
    assert said.startswith("compd compiles kernels")


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_every_kernel_of_a_build_gives_what_a_new_compilation_gives(tmp_path: Path) -> None:
    """To the last bit, by a hash of all that each kernel is given and gives in jobs that use all of them."""
    built, fresh, unwritable = tmp_path / "built", tmp_path / "fresh", tmp_path / "file"
    _copy_installation(built)
    _copy_installation(fresh)
    unwritable.write_text("")
    assert compile_for_levels(str(built / "compd" / jit.BUILT)) == []
    for level in LEVELS:
        target = {"NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": ""}
        of_build, said = _computed(_ALL_KERNELS, built, NUMBA_CACHE_DIR=str(unwritable), **target)
        assert said == ""
        calls = {name: int(count) for name, count, _ in map(str.split, of_build.decode().splitlines())}
        assert len(calls) > 20
        assert [name for name, count in calls.items() if not count] == []
        new, said = _computed(_ALL_KERNELS, fresh, NUMBA_CACHE_DIR=str(tmp_path / level), **target)
        assert said.startswith("compd compiles kernels")
        assert new == of_build


@pytest.mark.parametrize(
    ("machine", "features", "level"),
    [("x86_64", "v3", "x86-64-v3"), ("x86_64", "v2", "x86-64-v2"), ("aarch64", "neon", None), ("x86_64", "none", None)],
)
def test_the_level_is_that_of_the_processor_and_another_architecture_has_none(
    monkeypatch: pytest.MonkeyPatch, machine: str, features: str, level: str | None
) -> None:
    present = {"v3": LEVELS["x86-64-v3"], "v2": LEVELS["x86-64-v2"]}.get(features, {features})
    monkeypatch.setattr("platform.machine", lambda: machine)
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_features", lambda: dict.fromkeys(present, True))
    monkeypatch.setattr(kernel_target._config, "CPU_NAME", None)
    monkeypatch.setattr(kernel_target._config, "CPU_FEATURES", None)
    kernel_target.choose_target()
    assert level == kernel_target._config.CPU_NAME


# Runs a command where the processor is said to be of another architecture: numba compiles for what is there.
_ON_AARCH64 = """
import platform
import sys
platform.machine = lambda: "aarch64"
from compd.cli import main
sys.argv[0] = "compd"
main()
"""


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_check_on_another_architecture_says_that_it_compiles_and_works(tmp_path: Path) -> None:
    """The kernels of an installation are for x86-64: there a first start compiles, with one line that says so."""
    command = [sys.executable, "-c", _ON_AARCH64, "check", str(ROOT / "config" / "tripod-cmm.yaml")]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    first, second = (
        subprocess.run(
            command, env={**environment, "NUMBA_CACHE_DIR": str(tmp_path)}, capture_output=True, text=True, check=True
        )
        for _ in range(2)
    )
    assert re.fullmatch(
        rf"compd compiles kernels \(about 1 min\): none fit py\S+; kept in {tmp_path}\S+\n", first.stderr
    )
    assert "x86-64" not in first.stderr
    assert second.stderr == ""
    # how long a cycle takes is measured
    assert len({re.sub(r"takes \S+ ms", "takes", run.stdout) for run in (first, second)}) == 1


@pytest.mark.long
def test_kernels_work_where_nothing_can_be_kept(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    code = (
        "import numpy as np; from compd import jit; from compd.rotation import to_outer;"
        "print(repr(jit.CACHE_DIRECTORY), to_outer(np.eye(3), np.ones(3), np.zeros(3)).tolist())"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_CACHE_DIR": str(blocked)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "'' [1.0, 1.0, 1.0]"


@pytest.mark.long
@pytest.mark.sample
def test_processes_that_start_together_do_not_spoil_each_others_kernels(tmp_path: Path) -> None:
    """numba names a kernel by what its process compiled before, so these two do not agree on the name."""
    ours = "import numpy as np; from compd.rotation import compose;print(compose(np.eye(3), np.eye(3)).sum())"
    other = f"import numba; numba.njit(lambda x: x + 1)(1); {ours}"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}

    def start(code: str) -> subprocess.Popen[str]:
        return subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)

    together = [start(code) for code in (ours, other, ours, other)]
    afterwards = [process.communicate()[0].strip() for process in together]
    afterwards += [start(code).communicate()[0].strip() for code in (ours, other)]
    assert afterwards == ["3.0"] * 6


def _on_a_terminal(cache: Path) -> str:
    """What a process that uses a kernel prints on the terminal of its standard error."""
    ours, theirs = pty.openpty()
    code = "import numpy as np; from compd.rotation import compose; compose(np.eye(3), np.eye(3))"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    subprocess.run([sys.executable, "-c", code], env=environment, stderr=theirs, check=True)
    os.close(theirs)
    said = b""
    with suppress(OSError):  # the terminal's end
        while part := os.read(ours, 4096):
            said += part
    os.close(ours)
    return said.decode()


@pytest.mark.long
def test_a_terminal_that_waits_is_told_once(tmp_path: Path) -> None:
    said = _on_a_terminal(tmp_path)
    assert "compd compiles kernels (once, about 1 min): compose\r\033[K" in said
    assert said.endswith("\r\033[K")
    assert "\n" not in said
    assert _on_a_terminal(tmp_path) == ""


@pytest.mark.long
def test_a_terminal_is_told_that_nothing_can_be_kept(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    said = _on_a_terminal(blocked)
    assert "compd compiles kernels (at every start, as NUMBA_CACHE_DIR cannot be written): compose" in said
