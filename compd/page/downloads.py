"""Downloads: files of any size in pieces, as fast as their browser reads, until it has left."""

from __future__ import annotations

import asyncio
import io
import os
import zipfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from compd.page.limited_protocol import LimitedProtocol
from compd.page.requests import refused
from compd.page.shares import Places
from compd.page.workers.answering import gone

# Most downloads at once.
MAX_DOWNLOADS = 16
# Time limit (s) for a browser to take the next piece.
TAKEN_WITHIN_S = 60.0
PIECE_BYTES = 1 << 18
# Highest rate of one download: a fast network takes no processor from live events and from what is computed.
BYTES_PER_S = 32e6
# Threads that read the disk. They have the pieces of a download in turn.
_READERS = 2
_NO_LINK = os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC


class Downloads:
    """The running downloads of one page's server."""

    def __init__(self, most: int = MAX_DOWNLOADS, taken_within_s: float = TAKEN_WITHIN_S) -> None:
        self.places = Places(most)
        self.taken_within_s = taken_within_s
        self.readers = ThreadPoolExecutor(_READERS, "downloads")

    def answer(self, pieces: Iterator[bytes], media_type: str, headers: dict[str, str]) -> Response:
        """The answer to a request."""
        return _Download(self, pieces, headers=headers, media_type=media_type)


class _Download(Response):
    """It ends with its connection, or with a browser that does not read."""

    def __init__(self, downloads: Downloads, pieces: Iterator[bytes], headers: dict[str, str], media_type: str) -> None:
        super().__init__(headers=headers, media_type=media_type)
        del self.headers["content-length"]  # of an empty body
        self._downloads, self._pieces = downloads, pieces

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        token = scope.get("token")
        if (share := self._downloads.places.take(token)) is not None:
            reason = f"{share.most} downloads run already {share.whose}".rstrip()
            await refused(f"{reason}: wait until one of them has ended", 503)(scope, receive, send)
            return
        leaving = asyncio.ensure_future(gone(receive))
        try:
            await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
            await self._send(iter(()) if scope["method"] == "HEAD" else self._pieces, leaving, send)
        except TimeoutError:
            if (connection := LimitedProtocol.of(scope)) is not None:
                connection.note("too_slow")
                connection.drop()
        finally:
            leaving.cancel()
            self._downloads.places.give_back(token)

    async def _send(self, pieces: Iterator[bytes], leaving: asyncio.Future[None], send: Send) -> None:
        loop = asyncio.get_running_loop()
        more = True
        while more and not leaving.done():
            piece = await loop.run_in_executor(self._downloads.readers, next, pieces, b"")
            more = bool(piece)
            async with asyncio.timeout(self._downloads.taken_within_s):
                await send({"type": "http.response.body", "body": piece, "more_body": more})
            await asyncio.sleep(len(piece) / BYTES_PER_S)


class _Written(io.RawIOBase):
    """What was written since the last piece was taken."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: bytes) -> int:  # type: ignore[override]
        self._pieces.append(bytes(data))
        return len(data)

    def taken(self) -> bytes:
        """All of it, in one piece."""
        pieces, self._pieces = self._pieces, []
        return b"".join(pieces)


def in_pieces(data: bytes) -> Iterator[bytes]:
    """The bytes in pieces of a download."""
    return (data[start : start + PIECE_BYTES] for start in range(0, len(data), PIECE_BYTES))


def zipped(paths: Sequence[Path]) -> Iterator[bytes]:
    """A zip file of the files as they are, in pieces; of a file that grows meanwhile the part that is there."""
    written = _Written()
    with zipfile.ZipFile(written, "w", zipfile.ZIP_STORED) as archive:
        for path in paths:
            with os.fdopen(os.open(path, _NO_LINK), "rb") as source:
                entry = zipfile.ZipInfo.from_file(path, path.name, strict_timestamps=False)
                left = entry.file_size = os.fstat(source.fileno()).st_size
                with archive.open(entry, "w") as target:
                    while left and (piece := source.read(min(left, PIECE_BYTES))):
                        left -= target.write(piece)
                        yield written.taken()
    yield written.taken()
