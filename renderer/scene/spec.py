"""The frozen description of a job: the content of `scene.yaml` with every default filled in.

`renderer.scene.parse.parse_scene` makes a Scene from plain data and holds all checks. Nothing here imports numpy or
OpenGL, so that `hsplat check` answers at once. Lengths are in world units (those of the volume's spacing), angles in
degrees, colours in [0, 1] as given (display-referred), shapes, points and sizes in (x, y, z) and (width, height) order.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any, Literal

Vector = tuple[float, float, float]
Color = tuple[float, float, float]

# Bounds of spacings and of all lengths in a scene: an atom in light years is longer, the universe in picometres
# shorter. Squares, cubes and products of such lengths are far from float64's limits.
MIN_WORLD_LENGTH, MAX_WORLD_LENGTH = 1e-30, 1e30

# The smallest tolerance besides 0: smaller numbers have fewer digits, which interpolation would lose.
MIN_TOLERANCE = 1e-300

# The volumes of `renderer.readers.procedural`; here, so that names are checked without numpy.
PROCEDURAL_NAMES = ("engine_block", "constant", "single_voxel", "marschner_lobb")

# The frame number in file names, padded with zeros to at most nine digits, so that names sort in frame order.
FRAME_FIELD = re.compile(r"\{frame(:0[1-9]d?)?\}")


@dataclass(frozen=True)
class FileSource:
    """A volume in a format that describes itself: a file, or a folder (DICOM series or TIFF stack).

    `spacing` replaces the lengths in the file; directions and origin are kept.
    """

    file: Path
    spacing: Vector | None = None


@dataclass(frozen=True)
class RawSource:
    """Headerless voxels, x fastest; `dtype` is a numpy name without byte order, `offset` the bytes to skip."""

    file: Path
    shape: tuple[int, int, int]
    dtype: str
    byte_order: Literal["little", "big"] = "little"
    spacing: Vector = (1.0, 1.0, 1.0)
    offset: int = 0


@dataclass(frozen=True)
class ProceduralSource:
    """A volume made from a formula; `name` is one of PROCEDURAL_NAMES."""

    name: str
    shape: tuple[int, int, int]
    seed: int = 1
    spacing: Vector = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class ArraySource:
    """Voxels in memory, of a scene that is made in Python: a numpy array [z, y, x], which is never written to."""

    values: Any
    spacing: Vector = (1.0, 1.0, 1.0)

    @property
    def name(self) -> str:
        """What to call it in messages."""
        return "the array"

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of voxels along x, y, z."""
        return tuple(self.values.shape[::-1])


@dataclass(frozen=True)
class VolumeSpec:
    """The source of the voxels and the part to use; `crop` holds half-open voxel ranges (first, one past the last)
    for x, y, z."""

    source: FileSource | RawSource | ProceduralSource | ArraySource
    time: int | None = None
    component: int | None = None
    crop: tuple[tuple[int, int], tuple[int, int], tuple[int, int]] | None = None
    nonfinite: Literal["error", "lowest"] | float = "error"


@dataclass(frozen=True)
class ControlPoint:
    """Colour and opacity (in [0, 1], per `TransferSpec.unit`) at a scalar value, in data units."""

    value: float
    color: Color
    opacity: float


@dataclass(frozen=True)
class ColormapSpec:
    """A named colormap stretched over `range`, with opacity points (value, opacity)."""

    name: str
    range: tuple[float, float]
    opacity: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class TransferSpec:
    """Scalar to colour and extinction: either control points, values not descending, or a colormap.

    `unit` is the world length that opacities refer to; None means the volume's finest spacing.
    """

    mapping: tuple[ControlPoint, ...] | ColormapSpec
    unit: float | None = None


@dataclass(frozen=True)
class ShadingSpec:
    """View-independent Lambert shading; `light` points from the object to the light, in world axes."""

    ambient: float = 0.3
    diffuse: float = 0.7
    light: Vector = (1.0, -1.0, 1.0)


@dataclass(frozen=True)
class TurntablePath:
    """Azimuth `start + 360 f / frames`, constant elevation."""

    frames: int
    start: float = 0.0
    elevation: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class RockerPath:
    """Azimuth `start + swing / 2 * sin(2 pi f / frames)`: `swing` is the whole angle swept."""

    frames: int
    swing: float = 40.0
    start: float = 0.0
    elevation: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Keyframe:
    """The camera at one frame; `zoom` magnifies the picture relative to the path's distance."""

    frame: int
    azimuth: float
    elevation: float
    zoom: float = 1.0


@dataclass(frozen=True)
class KeyframePath:
    """Keys in ascending frame order, eased between them, directions interpolated on the sphere."""

    frames: int
    keys: tuple[Keyframe, ...]
    loop: bool = True
    easing: Literal["smooth", "linear"] = "smooth"
    axis: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class CameraSpec:
    """The camera and its path.

    target: None is the centre of the volume, "visible" the centre of what is visible. distance: None fits the whole
        path in the frame. field_of_view: an orthographic camera shows `2 distance tan(field_of_view / 2)` world units
        of height, as a perspective one does at the target. near: nothing nearer to the eye plane is drawn.
    """

    path: TurntablePath | RockerPath | KeyframePath
    projection: Literal["perspective", "orthographic"] = "perspective"
    field_of_view: float = 30.0
    target: Vector | Literal["visible"] | None = None
    distance: float | None = None
    near: float = 0.0


# (frame, value) in ascending frame order. One entry is constant; between two entries the value's logarithm is linear.
ByFrame = tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class SplatBudget:
    """The finest cut of at most this many cells, or bricks."""

    by_frame: ByFrame


@dataclass(frozen=True)
class TimeBudget:
    """The finest cut that this machine draws, rounds and encodes in this many seconds a frame."""

    by_frame: ByFrame


@dataclass(frozen=True)
class AccuracyGoal:
    """The coarsest tolerance whose frames are this near to the truth, over all pixels; one tolerance for the whole
    film."""

    metric: Literal["psnr", "rmse"]
    value: float


@dataclass(frozen=True)
class ErrorSpec:
    """The error schedule: a tolerance by frame or, with a `goal`, one that is found for it.

    Cells smaller than `2^finest_level` voxels are not drawn, whatever their error.
    """

    tolerance: ByFrame = ((0, 0.1),)
    measure: Literal["optical", "rms"] = "optical"
    of: Literal["classified", "scalar"] = "classified"
    finest_level: int = 0
    goal: SplatBudget | TimeBudget | AccuracyGoal | None = None


@dataclass(frozen=True)
class PyramidSpec:
    """What a node averages, and in which precision it is stored."""

    average: Literal["extinction", "opacity"] = "extinction"
    precision: Literal["half", "single"] = "half"


@dataclass(frozen=True)
class SplatSpec:
    """What is drawn, and how.

    footprint: `integrated`, the default of a scene, integrates the field through bricks of cells in their exact order
        and has no other settings; a section that sets anything asks for splats. sigma: the standard deviation of the
        footprint in cells. angular, radial, profile: the shape of the `gouraud` footprint; `profile` holds pairs of
        radius and weight, both in [0, 1], with the radius from 0 to 1.
    """

    footprint: Literal["gaussian", "gouraud", "integrated"] = "gaussian"
    sigma: float = 0.425
    angular: int = 8
    radial: int = 3
    profile: tuple[tuple[float, float], ...] = ((0.0, 1.0), (0.5, 0.6), (1.0, 0.0))
    opacity_correction: bool = True
    order: Literal["depth", "unmixed", "boxes"] = "depth"

    @property
    def primitive_name(self) -> str:
        """What is drawn, in the singular, for messages."""
        return "brick" if self.footprint == "integrated" else "splat"


@dataclass(frozen=True)
class OutputSpec:
    """The file, its size and its encoding.

    file: ends in .mp4 or .gif, or is a template of PNG frames such as `frames/{frame:04}.png` or, for one frame, a PNG.
        background: None is transparent (PNG, straight alpha). quality: 0 (smallest) to 10 (best), for MP4.
    """

    file: Path
    size: tuple[int, int] = (512, 512)
    frames_per_second: float = 30.0
    background: Color | None = (0.0, 0.0, 0.0)
    quality: float = 8.0


@dataclass(frozen=True)
class Scene:
    """One job, complete. With `overlay`, the edges of the drawn cells are drawn over the picture."""

    volume: VolumeSpec
    transfer_function: TransferSpec
    camera: CameraSpec
    output: OutputSpec
    error: ErrorSpec = ErrorSpec()
    splat: SplatSpec = SplatSpec("integrated")
    pyramid: PyramidSpec = PyramidSpec()
    shading: ShadingSpec | None = None
    overlay: Literal["none", "octree"] = "none"
    version: int = 1

    @property
    def needs_opengl(self) -> bool:
        """Whether it has splats or lines; bricks are drawn without OpenGL, too."""
        return self.splat.footprint != "integrated" or self.overlay != "none"


# All types that a scene is made of, for sending scenes to other processes.
SPEC_TYPES: tuple[type[Any], ...] = tuple(
    kind for kind in list(vars().values()) if isinstance(kind, type) and is_dataclass(kind)
)
