from .run_daemon import run as run
