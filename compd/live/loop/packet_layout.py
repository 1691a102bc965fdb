"""The binary setpoint's layout: one table of fields, by which it is packed and from which its reference is made."""

from __future__ import annotations

import struct
from typing import NamedTuple

from compd.setpoint_states import Mode

MAGIC = b"CMPD"
LAYOUT_VERSION = 2
FLAG_VALID = 1
FLAG_TOOL_ON_PLATE = 2
NO_TARGET_ID = -1
# Links that a packet has room for; a machine with fewer leaves the others nan.
PACKET_LINKS = 6


class PacketField(NamedTuple):
    """One field of the packet."""

    name: str  #: of the member in a C struct
    format: str  #: as `struct` writes it: a count, which may be left out, and a letter
    meaning: str  #: with its unit, for the reference

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return struct.calcsize(f"<{self.format}")


# Little-endian, without padding but that which is written here. A field is never moved or given another meaning: what
# is added comes with a new layout version.
PACKET_BODY: tuple[PacketField, ...] = (
    PacketField("magic", "4s", f"`{MAGIC.decode()}`, in ASCII"),
    PacketField("version", "H", f"version of this layout: {LAYOUT_VERSION}"),
    PacketField("size", "H", "size of the whole packet, bytes"),
    PacketField("seq", "Q", "number of the cycle, as `seq`"),
    PacketField("time_s", "d", "when the gauges were looked at, s, as `time_s`"),
    PacketField("valid_until_s", "d", "not to be used later than this, s, as `valid_until`"),
    PacketField("age_s", "d", "age of the oldest reading used, s, as `age_s`; nan where none was used"),
    PacketField(
        "flags",
        "H",
        f"sum of {FLAG_VALID} if the setpoint is valid and {FLAG_TOOL_ON_PLATE} if the tool stands on the plate",
    ),
    PacketField("state", "B", "code of the `state`"),
    PacketField("mode", "B", "code of the `mode`: " + ", ".join(f"{mode.code} {mode}" for mode in Mode)),
    PacketField("links", "B", "number of links that are corrected; 0 when invalid, and where the pose is corrected"),
    PacketField("spare", "3x", "0"),
    PacketField("tip_mm", "3d", "the tip, mm: `tip_M_mm`, or with the tool on the plate `tip_P_mm`"),
    PacketField("displacement_M_mm", "3d", "`frame.displacement_M_mm`, mm"),
    PacketField("rotation_M_rad", "3d", "`frame.rotation_M_rad`, rad"),
    PacketField("link_length_mm", f"{PACKET_LINKS}d", "`link_length_mm` of each link, mm"),
    PacketField("scale_setpoint_mm", f"{PACKET_LINKS}d", "`scale_setpoint_mm` of each link, mm"),
    PacketField(
        "correction_mm",
        f"{PACKET_LINKS}d",
        "`correction_mm` of each link, mm; with 0 links `tip_correction_mm` and `rotation_correction_rad`",
    ),
    PacketField("config_hash", "8s", "`config_hash`: its 16 hexadecimal digits as 8 bytes"),
    PacketField("target_time_s", "d", "`target_time_s` of the target that it answers, s; nan in mode cmm"),
    PacketField("target_id", "q", f"`target_id`; {NO_TARGET_ID} in mode cmm, and of a target without an id"),
)
PACKET_CHECKSUM = PacketField("crc32", "I", "CRC-32 of all bytes before it (zlib, IEEE 802.3)")
PACKET_FIELDS: tuple[PacketField, ...] = (*PACKET_BODY, PACKET_CHECKSUM)
# Packs the values of PACKET_BODY in their order; "spare" takes none.
BODY = struct.Struct("<" + "".join(field.format for field in PACKET_BODY))
PACKET_SIZE = BODY.size + PACKET_CHECKSUM.size
