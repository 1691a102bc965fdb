"""A correction by cause: what joints, frame and each effect ask for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from compd.arrays import FloatArray


class CorrectionShares(Mapping[str, FloatArray]):
    """The share (..., n) of each cause, by its name; their sum is the correction but for rounding.

    Attributes
    ----------
    causes : "joints", "frame", and the id of each effect.
    shares_mm : (K, ..., n), in the order of `causes`.
    """

    def __init__(self, causes: Sequence[str], shares_mm: FloatArray) -> None:
        self.causes = causes
        self.shares_mm = shares_mm

    def __getitem__(self, cause: str) -> FloatArray:
        if cause not in self.causes:
            raise KeyError(cause)
        share_mm: FloatArray = self.shares_mm[self.causes.index(cause)]
        return share_mm

    def __iter__(self) -> Iterator[str]:
        return iter(self.causes)

    def __len__(self) -> int:
        return len(self.causes)
