"""Which kernels compute here: what a last bit follows from, as the daemon greets its clients with it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache

import llvmlite.binding
import numba
import numpy as np

from compd.jit import kernel_digest
from compd.kernel_target import llvm_version, target_name
from compd.release import __version__


@cache
def kernel_versions() -> Mapping[str, str]:
    """What the last bits of a result follow from, by name.

    kernels : hash of the source of the compiled kernels. numba, llvm, numpy : releases. processor : its name at LLVM,
    and a hash of the instructions that it has. target : what the kernels are compiled for.
    """
    features = llvmlite.binding.get_host_cpu_features().flatten()
    return {
        "kernels": kernel_digest(),
        "numba": numba.__version__,
        "llvm": llvm_version(),
        "numpy": np.__version__,
        "processor": f"{llvmlite.binding.get_host_cpu_name()}-{hashlib.sha256(features.encode()).hexdigest()[:8]}",
        "target": target_name(),
    }


def versions_text(release: object, versions: Mapping[str, str] | None) -> str:
    """One line: the release of compd, and its kernels; None where they were not recorded."""
    if not versions:
        return f"compd {release}, kernels not recorded"
    return ", ".join([f"compd {release}", *(f"{name} {version}" for name, version in versions.items())])


def versions_text_here() -> str:
    """Those of this installation."""
    return versions_text(__version__, kernel_versions())
