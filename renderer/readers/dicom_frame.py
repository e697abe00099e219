"""A slice of a DICOM file: where it lies, what its stored values mean, and what tells it from others at its place."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from renderer.readers.dicom_fields import Dimension, Mark, unreadable_slice
from renderer.volume import Array, Float64


@dataclass(frozen=True)
class Frame:
    """A slice of a DICOM file.

    number: of its frame there, or None for an empty slice. size: pixels across and down. dtype: of its rescaled values.
    position: of its first pixel, float64 [3]. across, down: to the next pixel, float64 [3]. thickness: along the
        normal, if the file gives it; else 1. padding: the ends of the stored values that stand for no data.
    marks: what tells it from other frames at its place. corner: the pixel across and down where it begins in the
        stored frame. notes: remarks on how it was read; None stands for none.
    """

    file: Path
    number: int | None
    size: tuple[int, int]
    num_samples: int
    slope: float
    intercept: float
    dtype: np.dtype[Any]
    position: Float64
    across: Float64
    down: Float64
    thickness: float
    padding: tuple[float, float] | None = None
    marks: dict[Dimension, Mark] = field(default_factory=dict)
    corner: tuple[int, int] = (0, 0)
    notes: tuple[str | None, ...] = ()

    @property
    def label(self) -> str:
        """Return the name of the frame in messages."""
        return self.file.name + (f", frame {self.number + 1}" if self.number else "")

    @property
    def spacing(self) -> tuple[float, float]:
        """Return the distance of pixels across and down."""
        return float(np.linalg.norm(self.across)), float(np.linalg.norm(self.down))

    @property
    def orientation(self) -> list[float]:
        """Return the unit vectors across and down, one after the other."""
        across, down = self.spacing
        return [*(self.across / across).tolist(), *(self.down / down).tolist()]

    @property
    def normal(self) -> Float64:
        """Return the unit normal of the frame, float64 [3]."""
        normal = np.cross(self.across, self.down)
        return np.asarray(normal / np.linalg.norm(normal), np.float64)

    @property
    def nodata(self) -> tuple[float, float] | None:
        """Return the ends of the rescaled values that stand for no data; None if none do."""
        if self.padding is None:
            return None
        low, high = sorted(end * self.slope + self.intercept for end in self.padding)
        return low, high

    def stored(self, pixels: Array, channel: int) -> Array:
        """Return its stored values [y, x], a part of those of its file."""
        x, y = self.corner
        return pixels[self.number or 0, y : y + self.size[1], x : x + self.size[0], channel]

    def rescaled(self, stored: Array) -> Array:
        """Return the values of stored pixels, in the frame's dtype; raises InputError for floats in a file whose fields
        are those of integers."""
        if stored.dtype.kind == "f" and self.dtype.kind != "f":
            raise unreadable_slice(self.file, "save it again without BitsStored", "floats with the fields of integers")
        if self.slope == 1.0 and self.intercept == 0.0:
            return stored
        return np.asarray(stored * self.slope + self.intercept).astype(self.dtype)
