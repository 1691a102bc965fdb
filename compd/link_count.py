"""How many links and scales a machine has; the two differ where an actuator moves several links."""

from __future__ import annotations

from typing import Any, Self


class LinkCount(int):
    """Number of links n, which knows the number of scales m.

    It is an int, so that whoever asks for links alone needs nothing else; `scale_count` asks for scales.
    """

    scales: int

    def __new__(cls, links: int, scales: int) -> Self:
        """n links, m scales."""
        count = super().__new__(cls, links)
        count.scales = scales
        return count

    def __reduce__(self) -> tuple[Any, ...]:
        return LinkCount, (int(self), self.scales)


def scale_count(links: int) -> int:
    """Number of scales of a machine with so many links: one for each, unless `links` knows better."""
    return links.scales if isinstance(links, LinkCount) else links
