"""Declare the options of a suggested film besides its transfer function: a turntable, and its defaults."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from renderer.scene import OutputSpec, VolumeSpec, file_source

# The words by which a suggestion can be steered; `wishes.py` has a function for each. They are here, so that options
# are declared without numpy.
PRESET_WORDS = ("bone", "vessels", "skin", "brain", "xray", "surface", "glow", "labels")


@dataclass(frozen=True)
class FilmOptions:
    """A choice of the options of a turntable besides its volume.

    background: a colour or `transparent`. colormap, preset: as in `Wish`. over: the volume underneath.
    """

    frames: int = 120
    elevation: float = 20.0
    axis: str = "z"
    tolerance: float = 0.05
    size: tuple[int, int] = OutputSpec.size
    fps: float = OutputSpec.frames_per_second
    background: str = "#000000"
    colormap: str | None = None
    preset: str | None = None
    over: Path | None = None

    @property
    def under(self) -> VolumeSpec | None:
        """Return the volume underneath."""
        return None if self.over is None else VolumeSpec(file_source(self.over))
