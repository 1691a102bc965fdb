"""The worked example of docs/explanation/how-a-verdict-is-reached.md: its spreadsheet and its pictures.

`python -m docs.worked_example` simulates the recording, diagnoses it, and writes a spreadsheet with living formulas that
computes the verdict again, and the pictures, to docs/_build/worked-example/. `make docs` runs it when code has changed.
"""
