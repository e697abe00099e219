"""Define the choice of a level of a store, and say it in a sentence."""

from __future__ import annotations

from typing import NamedTuple

# The units of sizes, from the largest on, each with its exponent of 2.
_UNITS = (("GiB", 30), ("MiB", 20), ("KiB", 10))


class LevelChoice(NamedTuple):
    """A level of a store that was chosen for a scene that names none.

    number: the level, 0 for the finest. num_levels: the number of levels of the store. why: a clause that says why it
        was chosen.
    num_bytes: the bytes of its voxels. num_measured: the bytes of the finest level that were read to measure the error
        of coarser ones.
    asked: the PSNR that the scene asks for, in decibels.
    psnr: the estimated PSNR of exact pictures of the level against those of the finest one; None if not measured.
    least: the PSNR that counts, with an error that is larger by a margin for the few rays.
    is_exact: whether the level is as exact as the scene asks.
    """

    number: int
    num_levels: int
    why: str
    num_bytes: int
    num_measured: int
    asked: float
    psnr: float | None = None
    least: float | None = None
    is_exact: bool = True

    @property
    def note(self) -> str:
        """Return the choice as a sentence without its full stop."""
        error = measured = ""
        if self.least is not None:
            reached = f"{self.psnr:.0f} dB of the finest level, {self.least:.0f} with a margin"
            error = f"; {reached}; {self.asked:.0f} dB are asked for"
        if self.num_measured:
            measured = f", and {_size(self.num_measured)} of the finest level to measure"
        return (
            f"level {self.number} of 0 to {self.num_levels - 1} is drawn, {self.why}{error}; "
            f"{_size(self.num_bytes)} are read{measured}; `level: k` chooses another"
        )


def _size(num_bytes: int) -> str:
    """Return a number of bytes as text, such as `12.3 MiB`."""
    unit, shift = next(((unit, shift) for unit, shift in _UNITS if num_bytes >= 1 << shift), _UNITS[-1])
    return f"{num_bytes / (1 << shift):.3g} {unit}"
