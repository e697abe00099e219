"""Declare the options of a suggested film, such as a turntable, besides its volume and transfer function."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from renderer.scene import OutputSpec, VolumeSpec, file_source

# The names of the presets that a user can ask for; `wishes.py` has a function for each. They stand here so that options
# of the command line are declared without importing numpy.
PRESET_WORDS = ("bone", "vessels", "skin", "brain", "xray", "surface", "glow", "labels")

# The word for a film without a section `light`.
NO_LIGHT = "none"


@dataclass(frozen=True)
class FilmOptions:
    """The options of a turntable besides its volume.

    frames: the number of frames of a turn. elevation: the angle of the camera above the horizon, in degrees.
    axis: the world axis around which the camera turns. tolerance: the tolerance of all frames.
    size: the width and height of pictures, in pixels. fps: frames per second.
    background: a colour, or `transparent`.
    light: the name of an environment of `light`, which replaces shading; `none` for shading.
    colormap, preset: the colormap and the preset that the user asks for, as in `Wish`; None to choose by the volume.
    over: the file or the URL of a second volume, over which the first one is drawn; None without one.
    """

    frames: int = 120
    elevation: float = 20.0
    axis: str = "z"
    tolerance: float = 0.1
    size: tuple[int, int] = OutputSpec.size
    fps: float = OutputSpec.frames_per_second
    background: str = "#000000"
    light: str = NO_LIGHT
    colormap: str | None = None
    preset: str | None = None
    over: Path | str | None = None

    @property
    def under(self) -> VolumeSpec | None:
        """Return the volume over which the first one is drawn; None without one."""
        return None if self.over is None else VolumeSpec(file_source(self.over))
