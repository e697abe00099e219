"""Declare the options of a suggested film besides its volume and transfer function, such as those of a turntable."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from renderer.scene import OutputSpec, VolumeSpec, file_source

# The words by which a user can steer a suggestion; `wishes.py` has a function for each. They stand here so that options
# are declared without importing numpy.
PRESET_WORDS = ("bone", "vessels", "skin", "brain", "xray", "surface", "glow", "labels")


@dataclass(frozen=True)
class FilmOptions:
    """The options of a turntable besides its volume.

    background: a colour or `transparent`.
    colormap, preset: as in `Wish`.
    over: the file of a second volume, over which the first one is drawn.
    """

    frames: int = 120
    elevation: float = 20.0
    axis: str = "z"
    tolerance: float = 0.1
    size: tuple[int, int] = OutputSpec.size
    fps: float = OutputSpec.frames_per_second
    background: str = "#000000"
    colormap: str | None = None
    preset: str | None = None
    over: Path | None = None

    @property
    def under(self) -> VolumeSpec | None:
        """Return the volume over which the first one is drawn; None without one."""
        return None if self.over is None else VolumeSpec(file_source(self.over))
