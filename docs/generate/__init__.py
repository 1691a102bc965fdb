"""The pages of the documentation that are made from the code, one module per page.

A module that has a function `page()` is a page, which it returns in Markdown; `python -m docs.generate` writes each to
docs/reference/NAME.md, where NAME is the module's name with `-` for `_`. None of them is kept in the repository.
"""
