"""Mended defects of the live half, each as a patch that puts it back, and how soon fresh worlds find them again.

`defects.yaml` describes them. `python -m tests.worlds.defects` measures; see `tests.worlds.defects.find`.
This package imports nothing of compd, since its `start` chooses which copy of compd a process imports.
"""
