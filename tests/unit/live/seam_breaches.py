"""Calls by which product code goes around `System`: found in its source."""

from __future__ import annotations

import ast
from collections.abc import Iterator

# Modules of which nothing may be used.
MODULES = ("_thread", "asyncio", "concurrent", "ctypes", "multiprocessing", "sched", "select", "subprocess", "time")
# Names that read a clock, wait, start a thread or process, open a port, or choose the computer.
NAMES = frozenset(
    f"{module}.{name}"
    for module, names in {
        "builtins": "open",
        "compd.clock": "MonotonicClock",
        "compd.files": "read_descriptor read_small_file sync_directory write_files write_new_file",
        "compd.lines": "PORTS",
        "compd.lines.port": "SerialPort TcpPort",
        "compd.lines.ports": "PORTS",
        "compd.live.system": "THIS_COMPUTER",
        "compd.live.system.system": "THIS_COMPUTER",
        "datetime.date": "today",
        "datetime.datetime": "now today utcnow",
        "io": "open",
        "os": "environ environb fork forkpty getenv open pidfd_open popen posix_spawn system waitpid",
        "selectors": "DefaultSelector DevpollSelector EpollSelector KqueueSelector PollSelector SelectSelector",
        "serial": "Serial serial_for_url",
        "signal": "alarm pause pthread_kill set_wakeup_fd setitimer signal sigwait sigtimedwait sigwaitinfo",
        "socket": "create_connection create_server getaddrinfo socket",
        "threading": "Barrier BoundedSemaphore Condition Semaphore Thread Timer excepthook",
    }.items()
    for name in names.split()
)
# Methods of paths.
FILE_METHODS = frozenset({"mkdir", "read_bytes", "read_text", "touch", "write_bytes", "write_text"})
# What waits behind the seam, by the names that the product gives it.
WAITS_BY_SEAM = frozenset({"clock", "_clock", "system", "_system"})


def breaches(source: str) -> Iterator[tuple[int, str]]:
    """Line number and name of each call around the seam; a method is `.name()`, a queue's blocking one `.get()`."""
    tree = ast.parse(source)
    imported = dict(_imports(tree))
    parts = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    for node in _outside_annotations(tree):
        if isinstance(node, ast.Name | ast.Attribute) and id(node) not in parts:
            name = _full_name(node, imported)
            if name.partition(".")[0] in MODULES or any(f"{name}.".startswith(f"{known}.") for known in NAMES):
                yield node.lineno, name
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and _is_method_around(node, node.func):
            yield node.lineno, f".{node.func.attr}()"


def _imports(tree: ast.AST) -> Iterator[tuple[str, str]]:
    """Each name that an import binds, anywhere in the file, and its full name."""
    yield "open", "builtins.open"
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield (alias.asname, alias.name) if alias.asname else (alias.name.partition(".")[0],) * 2
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                yield alias.asname or alias.name, f"{node.module}.{alias.name}"


def _outside_annotations(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes below this one but those of annotations."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield child
                yield from _outside_annotations(child)


def _full_name(node: ast.expr, imported: dict[str, str]) -> str:
    """`threading.Thread` for a name or an attribute of what was imported; "" for any other."""
    if isinstance(node, ast.Name):
        return imported.get(node.id, "")
    if isinstance(node, ast.Attribute) and (before := _full_name(node.value, imported)):
        return f"{before}.{node.attr}"
    return ""


def _is_method_around(call: ast.Call, method: ast.Attribute) -> bool:
    receiver = getattr(method.value, "attr", getattr(method.value, "id", ""))
    keys = {keyword.arg for keyword in call.keywords}
    match method.attr:
        case "wait":
            return receiver not in WAITS_BY_SEAM
        case "get":
            return not call.args and keys <= {"block", "timeout"}
        case "open":  # of a path: with a mode, or as text
            mode = call.args and isinstance(call.args[0], ast.Constant)
            return bool(mode or keys & {"mode", "encoding", "newline"})
        case name:
            return name in FILE_METHODS
