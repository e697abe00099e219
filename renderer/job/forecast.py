"""State the cost of a film, in seconds and in bytes, before it is made."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:  # these packages load numpy, which a listener to a job does not need
    from renderer.accuracy import Glance
    from renderer.draw import BrickMemory


class LightCost(NamedTuple):
    """The cost of the light that matter scatters on one frame."""

    # The width of a cell, in the finest spacing of all volumes.
    cell_voxels: float
    # The number of cells along x, y, z.
    shape_xyz: tuple[int, int, int]
    # The bytes that are taken while the light is found.
    num_bytes: int
    # The time in which the light was found; 0 if it was known.
    seconds: float


@dataclass(frozen=True)
class Forecast:
    """A prediction of the cost of a film: seconds, and the bytes of each output by its file.

    glances: the faults of the film's pictures, if pictures were looked at. brick_memory: the bytes that the visible
    bricks need, and may take; None if no bricks were drawn here. light: the cost of the light of the first frame; None
    for a scene without `light`. exposure: the exposure that `light.exposure: auto` chose, in stops; None if the scene
    gives it.
    """

    seconds: float
    num_bytes: Mapping[Path, float]
    glances: Sequence[Glance] = ()
    brick_memory: BrickMemory | None = None
    light: LightCost | None = None
    exposure: float | None = None

    @property
    def seconds_text(self) -> str:
        """Return the predicted time as text: `2.1 s`, `35 s` or `12 min`."""
        return f"{self.seconds:.2g} s" if self.seconds < 99.5 else f"{self.seconds / 60:.0f} min"

    def bytes_text(self, files: Collection[Path]) -> str:
        """Return the predicted size of some files together as text: `35 kB`, `2.1 MB` or `850 MB`."""
        kilobytes = sum(self.num_bytes.get(file, 0.0) for file in files) / 1e3
        number, unit = (kilobytes, "kB") if kilobytes < 99.5 else (kilobytes / 1e3, "MB")
        return f"{number:.2g} {unit}" if number < 99.5 else f"{number:.0f} {unit}"
