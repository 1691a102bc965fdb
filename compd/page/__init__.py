"""The page in the browser: a process of its own between one daemon and any number of browsers."""
