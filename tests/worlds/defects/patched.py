"""A copy of compd with a patch, and programs that run with it.

The copy takes along what Python and numba compiled of the tree, so that a program starts within seconds and writes
nothing into the tree.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from subprocess import PIPE
from typing import NamedTuple

from compd import jit
from compd.compile_kernels import kernel_modules
from tests.support.paths import ROOT

_MEMORY = Path("/dev/shm")


class Patched(NamedTuple):
    """A copy of compd in the directory `path`. digest : of the sources of the kernels that it took along."""

    path: Path
    digest: str

    def start(self, module: str, *arguments: str) -> subprocess.Popen[str]:
        """Start a module of the tree as a program that imports this copy of compd."""
        return started("tests.worlds.defects.start", str(self.path), self.digest, module, *arguments)


def started(module: str, *arguments: str) -> subprocess.Popen[str]:
    """Start a module of the tree as a program; its errors come out here."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    command = [sys.executable, "-m", module, *arguments]
    return subprocess.Popen(command, cwd=ROOT, env=environment, stdin=PIPE, stdout=PIPE, text=True)


@contextmanager
def patched(patch: Path | None) -> Iterator[Patched]:
    """Within, a copy of compd exists with this patch, or as it is. Raises ValueError if the patch does not apply."""
    with tempfile.TemporaryDirectory(prefix="compd-patched-", dir=_MEMORY if _MEMORY.is_dir() else None) as name:
        path = Path(name)
        shutil.copytree(ROOT / "compd", path / "compd", ignore=shutil.ignore_patterns("kernels-*"))
        touched = [] if patch is None else apply(patch, path)
        if not any(map(_is_shared, touched)):
            _take_kernels(path / "kernels")
        yield Patched(path, jit.kernel_digest())


def apply(patch: Path, directory: Path) -> list[str]:
    """Apply a patch below a directory, which may lie in a repository; the files that it changes."""
    environment = os.environ | {"GIT_CEILING_DIRECTORIES": str(directory.parent)}

    def git_apply(*options: str) -> str:
        command = ["git", "apply", *options, str(patch)]
        done = subprocess.run(command, check=False, cwd=directory, env=environment, capture_output=True, text=True)
        if done.returncode:
            raise ValueError(f"{patch} does not apply: {done.stderr}")
        return done.stdout

    files = [line.split("\t")[2] for line in git_apply("--numstat").splitlines()]
    git_apply()
    return files


def _is_shared(file: str) -> bool:
    """Whether kernels in other files are compiled from this one: numba does not see that it has changed."""
    module = ".".join(Path(file).with_suffix("").parts)
    sources = [source for source in jit.kernel_sources() if source != ROOT / file]
    return any(f"from {module} import" in source.read_text(encoding="utf-8") for source in sources)


def _take_kernels(directory: Path) -> None:
    """Copy the tree's compiled kernels, after compiling those that are missing."""
    for module in kernel_modules():
        import_module(module)
    if jit.CACHE_DIRECTORY:
        shutil.copytree(jit.CACHE_DIRECTORY, directory)
