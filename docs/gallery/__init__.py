"""The gallery: simulated machines with hidden causes, and what the workbench says about them.

`python -m docs.gallery` measures and diagnoses every case of `cases.py` and writes the pages and pictures to
docs/_build/ and the text, which docs/gallery/index.md includes, to docs/gallery/cases.md. Nothing of it is kept in the
repository; `make docs` runs it again when the code has changed.
"""
