"""The packages that some jobs alone need: they come with an extra of compd, such as compd[page]."""

from __future__ import annotations

from compd.errors import Problem

# The packages of each extra of pyproject.toml, as they are imported.
EXTRAS = {
    "report": ("plotly",),
    "page": ("segno", "starlette", "uvicorn"),
    "parquet": ("pyarrow",),
    "fleet": ("dask", "distributed"),
    "notebook": ("pandas",),
    "opcua": ("asyncua", "cryptography"),
    "mqtt": ("paho",),
}


def install_line(extra: str) -> str:
    """What a person types to have the packages of an extra."""
    return f"pip install 'compd[{extra}]'"


def missing_package(where: str, error: ImportError) -> Problem | None:
    """The problem of an import that failed for want of an extra; None for any other import. where : what needs it."""
    package = (error.name or "").partition(".")[0]
    extra = next((extra for extra, packages in EXTRAS.items() if package in packages), None)
    if extra is None:
        return None
    what = f"needs the package {package}, which is not installed"
    return Problem(where, what, next_step=install_line(extra))
