"""Sphinx's configuration; `make docs` builds the pages."""

from __future__ import annotations

from pathlib import Path

from compd import __version__

project = "compd"
author = "the compd developers"
copyright = "2026, the compd developers"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
# gallery/cases.md is a part of gallery/index.md
exclude_patterns = ["_build", "gallery/cases.md"]
myst_enable_extensions = ["colon_fence", "deflist", "fieldlist"]
myst_heading_anchors = 3

autodoc_typehints = "description"
# results are made by functions: their constructors' parameters are nobody's business
autodoc_typehints_description_target = "documented_params"
autodoc_type_aliases = dict.fromkeys(("FloatArray", "BoolArray", "IntArray", "TextArray"), "numpy.ndarray")
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_ivar = True
# `name` in a docstring: a link where it is a documented name, code elsewhere
default_role = "py:obj"

# `--option` and "" are to be read as they are typed.
smartquotes = False

html_theme = "furo"
html_title = f"compd {release}"
html_static_path = ["static"]
# the gallery's own pages, where `python -m docs.gallery` has made them
html_extra_path = [name for name in ("_build/gallery",) if (Path(__file__).parent / name).is_dir()]
html_css_files = ["compd.css"]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
templates_path: list[str] = []
