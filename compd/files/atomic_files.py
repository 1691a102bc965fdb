"""Files on the disk: written whole or not at all, so that neither a crash nor a full disk leaves half a file."""

from __future__ import annotations

import errno
import fcntl
import os
import secrets
import socket
import stat
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO, TypeAlias

# What a file is to hold: text (as UTF-8), bytes, or, where it is long, a function that writes it.
Content: TypeAlias = str | bytes | Callable[[BinaryIO], None]
# struct linger of socket(7): off.
_NO_LINGER = struct.pack("2i", 0, 0)


def write_files(contents: Mapping[Path, Content], mode: int | None = None) -> None:
    """Write all of these files, or leave every one as it was.

    Each file is written under a temporary name in its own directory, synced to the disk and then renamed over its
    path, in the order of the mapping; at the end the directories are synced. A reader sees the old or the new file,
    never a part. After a failed rename the files that were renamed before it get their previous content back.

    Parameters
    ----------
    contents : path -> what the file is to hold; text is encoded as UTF-8, line ends are written as they are. What a
        function raises is raised, and then every file is as it was.
    mode : permission bits of the files; None for those that the umask gives.

    Raises
    ------
    OSError
        Where the disk refuses; the directories must exist. Only after an error of the last step, the sync of the
        directories, the new files are in place all the same.

    Examples
    --------
    >>> write_files({Path("run.yaml"): sidecar_text, Path("run.csv"): csv_text})
    """
    temporaries = {path: path.with_name(f".{path.name}.{secrets.token_hex(4)}") for path in contents}
    previous: dict[Path, bytes | None] = {}
    *earlier_paths, last_path = contents
    try:
        for path, temporary in temporaries.items():
            write_new_file(temporary, contents[path])
            if mode is not None:
                temporary.chmod(mode)
        for path in earlier_paths:
            content = path.read_bytes() if path.exists() else None
            temporaries[path].replace(path)
            previous[path] = content
        temporaries[last_path].replace(last_path)
    except OSError:
        _restore(previous)
        raise
    finally:
        for temporary in temporaries.values():
            temporary.unlink(missing_ok=True)
    for directory in {path.parent for path in contents}:
        sync_directory(directory)


def file_stamp(path: Path) -> tuple[int, int] | None:
    """When a file was last written (ns) and its length (bytes), which tell whether it was changed.

    None where it cannot be looked at.
    """
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def read_small_file(path: Path, limit_bytes: int) -> bytes:
    """The content of a regular file of at most `limit_bytes`; a pipe or a device is neither waited for nor opened.

    Raises OSError, also for what is no regular file, or is longer.
    """
    return read_descriptor(open_regular(path), limit_bytes)


def open_regular(path: Path, follow_link: bool = True) -> int:
    """A descriptor of a regular file, open for reading; a pipe or a device is neither waited for nor opened.

    follow_link : whether the last part of the path may be a symbolic link. Raises OSError.
    """
    _require_regular(path.stat(follow_symlinks=follow_link).st_mode)
    flags = os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC | (0 if follow_link else os.O_NOFOLLOW)
    return os.open(path, flags)


def read_descriptor(descriptor: int, limit_bytes: int) -> bytes:
    """What `read_small_file` does, for a file that is open; it is closed in any case.

    It is read from its start, wherever whoever shares the descriptor has read to, and to where it ends now: a file
    that the system makes while it is read, as those in /proc, has no length and is empty.
    """
    try:
        status = os.fstat(descriptor)
        _require_regular(status.st_mode)
        if fcntl.fcntl(descriptor, fcntl.F_GETFL) & (os.O_ACCMODE | os.O_PATH) not in (os.O_RDONLY, os.O_RDWR):
            raise OSError(errno.EBADF, "it is not open for reading")
        if status.st_size > limit_bytes:
            raise OSError(errno.EFBIG, f"it has more than {limit_bytes} bytes")
        content = bytearray()
        while piece := os.pread(descriptor, status.st_size - len(content), len(content)):
            content += piece
    finally:
        close_descriptor(descriptor)
    return bytes(content)


def close_descriptor(descriptor: int) -> None:
    """Close what somebody else has opened; a socket does not linger until what was sent has arrived. Raises OSError."""
    if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
        with socket.socket(fileno=descriptor) as other:
            other.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)
    else:
        os.close(descriptor)


def _require_regular(mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "it is a directory")
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is not a regular file")


def write_new_file(path: Path, content: Content) -> None:
    """Write a file that must not exist yet, and sync it to the disk. Raises OSError (FileExistsError)."""
    with path.open("xb") as file:
        if callable(content):
            content(file)
        else:
            file.write(content.encode() if isinstance(content, str) else content)
        file.flush()
        os.fsync(file.fileno())


def sync_directory(directory: Path) -> None:
    """Sync a directory to the disk: a new or renamed file survives a power cut only after that. Raises OSError."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _restore(previous: Mapping[Path, bytes | None]) -> None:
    """Give files their previous content back; None: there was no file."""
    for path, content in previous.items():
        if content is None:
            path.unlink()
        else:
            path.write_bytes(content)
