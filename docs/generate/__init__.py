"""The pages of the documentation that are made from the code, one module per page.

A module here has a function `page()`, which returns the page in Markdown; `python -m docs.generate` writes each to
docs/reference/NAME.md, where NAME is the module's name with `-` for `_`. None of them is kept in the repository.
"""
