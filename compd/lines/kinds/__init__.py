"""The kinds of line: a folder each, named as `kind` in the configuration. See `compd.lines.line_definition`."""
