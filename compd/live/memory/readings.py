"""Readings as they are in shared memory, one slot of 256 bytes per channel.

A slot has the reading's value (nan where there is none) and monotonic time, its `ReadingMotion` (nan where there is
none), the number of its Quality, the length of its detail in bytes, a CRC-32 of all that is before and after it in the
slot, and the detail in UTF-8. SLOT is the layout.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, Self, overload

import numpy as np
from numba import from_dtype, types
from numpy.typing import NDArray

from compd.gauge import Quality, Reading, ReadingMotion
from compd.jit import INDICES, helper, loop

# Of a slot, in bytes.
_DETAIL_BYTES = 152
_NUMBERS = ("value", "time_s", *ReadingMotion._fields)
# The slot as an element of an array, for kernels. It has no padding, so that it can be packed field by field.
SLOT = np.dtype(
    [
        *((name, np.float64) for name in _NUMBERS),
        ("quality", np.uint8),
        ("length", np.uint8),
        ("unused", np.uint16),
        ("checksum", np.uint32),
        ("detail", np.uint8, _DETAIL_BYTES),
    ]
)


def _struct_up_to(end: str | None) -> struct.Struct:
    """The fields of SLOT before the field `end`; None for all."""
    names = SLOT.names or ()
    types_ = [SLOT[name] for name in names[: None if end is None else names.index(end)]]
    return struct.Struct("=" + "".join(f"{each.itemsize}s" if each.subdtype else each.char for each in types_))


_SLOT, _HEAD, _CHECKED = _struct_up_to(None), _struct_up_to("detail"), _struct_up_to("checksum")
_CHECKED_BYTES = _CHECKED.size
_HEAD_BYTES = _HEAD.size
_LENGTH_OFFSET = sum(SLOT[name].itemsize for name in (*_NUMBERS, "quality"))
SLOT_BYTES = _SLOT.size
MAX_DETAIL = _DETAIL_BYTES
_NO_MOTION = (math.nan,) * len(ReadingMotion._fields)

_QUALITIES = tuple(Quality)
_QUALITY_NUMBERS = {quality: number for number, quality in enumerate(_QUALITIES)}
OK_NUMBER = _QUALITY_NUMBERS[Quality.OK]

SLOTS = types.Array(from_dtype(SLOT), 1, "C", readonly=True)
_CONTENTS = types.Array(types.uint8, 2, "C", readonly=True)
_KEPT = types.uint8[:, ::1]
_VERSIONS = types.uint64[::1]


def pack(reading: Reading) -> bytes:
    """A reading as the content of a slot; a longer detail is cut off."""
    value, time_s, quality, detail, motion = reading
    moves = motion or _NO_MOTION
    text = b""
    if detail:
        text = detail.encode(errors="replace")[:MAX_DETAIL].decode(errors="ignore").encode()
    number = _QUALITY_NUMBERS[quality]
    checksum = zlib.crc32(text, zlib.crc32(_CHECKED.pack(value, time_s, *moves, number, len(text), 0)))
    return _SLOT.pack(value, time_s, *moves, number, len(text), 0, checksum, text)


def _crc_table() -> NDArray[np.int64]:
    """(256,) remainder of each byte by the polynomial of CRC-32 (IEEE 802.3), reflected."""
    table = np.arange(256, dtype=np.int64)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ 0xEDB88320, table >> 1)
    return table


_CRC_TABLE = _crc_table()


@helper
def _is_whole(content: NDArray[np.uint8]) -> bool:
    """Whether the checksum of a slot fits."""
    length = np.int64(content[_LENGTH_OFFSET])
    if length > MAX_DETAIL:
        return False
    crc = np.int64(0xFFFFFFFF)
    for i in range(_CHECKED_BYTES):
        crc = _CRC_TABLE[(crc ^ np.int64(content[i])) & 0xFF] ^ (crc >> 8)
    for i in range(_HEAD_BYTES, _HEAD_BYTES + length):
        crc = _CRC_TABLE[(crc ^ np.int64(content[i])) & 0xFF] ^ (crc >> 8)
    checksum = np.int64(0)
    for i in range(4):
        checksum |= np.int64(content[_CHECKED_BYTES + i]) << (8 * i)
    return bool(crc ^ 0xFFFFFFFF == checksum)


@loop([_CONTENTS])
def all_whole(contents: NDArray[np.uint8]) -> bool:
    """Whether the checksums of all slots (K, SLOT_BYTES) fit."""
    for k in range(len(contents)):  # noqa: SIM110  # compiled
        if not _is_whole(contents[k]):
            return False
    return True


@helper
def _is_at_rest(before: NDArray[np.uint64], after: NDArray[np.uint64], k: int) -> bool:
    return bool(before[k] == after[k] and before[k] & np.uint64(1) == 0)


@loop([_VERSIONS, _VERSIONS, _VERSIONS, INDICES, _CONTENTS, _KEPT])
def take_changed(
    before: NDArray[np.uint64],
    after: NDArray[np.uint64],
    seen: NDArray[np.uint64],
    group: NDArray[np.int64],
    contents: NDArray[np.uint8],
    kept: NDArray[np.uint8],
) -> bool:
    """Take the slots that have changed from a copy of all slots; whether there were any.

    A slot is taken where its versions before and after the copy are the same and even, and its checksum fits.

    before, after : (K,) versions.  seen : (K,) those that were taken last; written.
    group : (K,) the group of slots that are taken together, numbered from 0; -1 where a slot has none.
    contents, kept : (K, SLOT_BYTES), the copy and the slots that were taken last; written.
    """
    changed = False
    for k in range(len(before)):
        if before[k] == seen[k]:
            continue
        changed = True
        if not _is_at_rest(before, after, k):
            continue
        waits = False
        if group[k] >= 0:  # one of a group is odd as long as not all are there
            for other in range(len(before)):
                if group[other] == group[k] and not _is_at_rest(before, after, other):
                    waits = True
        if not waits and _is_whole(contents[k]):
            kept[k] = contents[k]
            seen[k] = before[k]
    return changed


def contents_of(image: bytes) -> NDArray[np.uint8]:
    """(K, SLOT_BYTES) bytes of the slots, read-only."""
    return np.frombuffer(image, dtype=np.uint8).reshape(-1, SLOT_BYTES)


class Readings(Sequence[Reading]):
    """The readings of all channels at one time, in the order of `Latest.channels`; they do not change.

    They stay as bytes, of which a `Reading` is made when somebody asks for it: a cycle computes with `slots`.
    """

    def __init__(self, image: bytes) -> None:
        """`image`: slots whose checksums fit."""
        self.image = image  #: the bytes, one slot after the other

    @classmethod
    def of(cls, readings: Iterable[Reading]) -> Self:
        """From single readings; a longer detail is cut off."""
        return cls(b"".join(map(pack, readings)))

    @classmethod
    def checked(cls, image: bytes) -> Self:
        """From bytes that come from elsewhere. Raises ValueError for damaged ones."""
        if len(image) % SLOT_BYTES or not all_whole(contents_of(image)):
            raise ValueError("a damaged reading")
        return cls(image)

    @cached_property
    def slots(self) -> NDArray[Any]:
        """(K,) of SLOT, read-only."""
        return np.frombuffer(self.image, dtype=SLOT)

    def __repr__(self) -> str:
        return f"Readings({tuple(self)})"

    def __len__(self) -> int:
        return len(self.image) // SLOT_BYTES

    @overload
    def __getitem__(self, index: int) -> Reading: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Reading, ...]: ...
    def __getitem__(self, index: int | slice) -> Reading | tuple[Reading, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        start = range(len(self))[index] * SLOT_BYTES
        value, time_s, *moves, number, length, _, _ = _HEAD.unpack_from(self.image, start)
        motion = ReadingMotion(*moves)
        text = start + _HEAD_BYTES
        detail = self.image[text : text + length].decode() if length else ""
        return Reading(value, time_s, _QUALITIES[number], detail, None if math.isnan(motion.horizon_s) else motion)
