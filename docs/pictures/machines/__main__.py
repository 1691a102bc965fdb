"""Write the pictures: `python -m docs.pictures.machines`."""

from __future__ import annotations

from docs.pictures.machines import HERE, pictures

for name, text in pictures().items():
    (HERE / name).write_text(text, encoding="utf-8")
