"""The frozen description of a job: what `scene.yaml` says, with every default filled in.

Nothing here imports numpy or GL, so that `hsplat check` answers at once. `renderer.scene.parse.parse_scene` makes a
Scene from plain Python data and holds every check of a single value or of several together. Lengths are in world
units (those of the volume's spacing), angles in degrees, colours in [0, 1] as given (display-referred), shapes,
points and sizes in (x, y, z) and (width, height) order.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, is_dataclass
from pathlib import Path
from typing import Any, Literal

Vector = tuple[float, float, float]
Color = tuple[float, float, float]

# Of spacings, and of all that is a length in a scene: an atom in light years is longer, and the universe in picometres
# shorter. Squares and cubes of such lengths, and products of a few, are far from float64's limits.
MIN_WORLD_LENGTH, MAX_WORLD_LENGTH = 1e-30, 1e30

# Of tolerances other than 0: smaller numbers have fewer digits, and are lost where they are interpolated.
MIN_TOLERANCE = 1e-300

# What `renderer.readers.procedural` can make; here because the schema checks names without importing numpy.
PROCEDURAL_NAMES = ("engine_block", "constant", "single_voxel", "marschner_lobb")

# The number in the names of frames: padded with zeros, to nine digits at most, so that names sort in their order.
FRAME_FIELD = re.compile(r"\{frame(:0[1-9]d?)?\}")


@dataclass(frozen=True)
class FileSource:
    """A volume in a format that describes itself: a file, or a folder (DICOM series or TIFF stack).

    `spacing` takes the place of the lengths that the file says or leaves open; directions and origin stay the file's.
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
    """Which voxels: `crop` holds half-open voxel ranges (first, one past the last) for x, y, z."""

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
    """The camera at one frame; `zoom` magnifies the picture against the path's distance (perspective or not)."""

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
    """`target` None is the centre of the volume, "visible" the centre of what is visible; `distance` None fits the
    whole path in the frame. An orthographic camera shows `2 distance tan(field_of_view / 2)` world units of height, as
    a perspective one does at the target. Nothing nearer than `near` to the eye plane is drawn."""

    path: TurntablePath | RockerPath | KeyframePath
    projection: Literal["perspective", "orthographic"] = "perspective"
    field_of_view: float = 30.0
    target: Vector | Literal["visible"] | None = None
    distance: float | None = None
    near: float = 0.0


# (frame, value) in ascending frame order; one entry is constant, between two the value's logarithm is linear.
ByFrame = tuple[tuple[int, float], ...]


@dataclass(frozen=True)
class SplatBudget:
    """The finest cut of at most so many cells, or bricks."""

    by_frame: ByFrame


@dataclass(frozen=True)
class TimeBudget:
    """The finest cut that this machine draws, rounds and encodes in so many seconds a frame."""

    by_frame: ByFrame


@dataclass(frozen=True)
class AccuracyGoal:
    """The coarsest tolerance whose frames are so near to the truth, over all pixels; the same for the whole film."""

    metric: Literal["psnr", "rmse"]
    value: float


@dataclass(frozen=True)
class ErrorSpec:
    """The error schedule: a tolerance by frame or, with a `goal`, the one that has to be found for it. No cell smaller
    than `2^finest_level` voxels is drawn, whatever its error."""

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
    """`sigma` is the standard deviation of the footprint in cells; `angular`, `radial` and `profile` (pairs of radius
    and weight, both in [0, 1], radius from 0 to 1) shape the `gouraud` footprint. `integrated` has nothing to choose:
    the field is integrated through bricks of cells, in their exact order. It is what a scene without a SplatSpec draws;
    one that says how splats are to be asks for them."""

    footprint: Literal["gaussian", "gouraud", "integrated"] = "gaussian"
    sigma: float = 0.425
    angular: int = 8
    radial: int = 3
    profile: tuple[tuple[float, float], ...] = ((0.0, 1.0), (0.5, 0.6), (1.0, 0.0))
    opacity_correction: bool = True
    order: Literal["depth", "unmixed", "boxes"] = "depth"

    @property
    def primitive_name(self) -> str:
        """What is drawn, in the singular, for messages: a frame's `num_splats` and a cut's `num_cells` count them."""
        return "brick" if self.footprint == "integrated" else "splat"


@dataclass(frozen=True)
class OutputSpec:
    """`file` ends in .mp4 or .gif, or is a template of PNG frames such as `frames/{frame:04}.png` or, where one frame
    is drawn, a PNG; `background` None is transparent (PNG, straight alpha); `quality` is 0 (smallest) to 10 (best),
    for MP4."""

    file: Path
    size: tuple[int, int] = (512, 512)
    frames_per_second: float = 30.0
    background: Color | None = (0.0, 0.0, 0.0)
    quality: float = 8.0


@dataclass(frozen=True)
class Scene:
    """One job, complete. With `overlay`, lines along the edges of the cells that are drawn lie over the picture."""

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
        """Whether it has splats or lines; bricks are drawn without it, too."""
        return self.splat.footprint != "integrated" or self.overlay != "none"


# Everything that a scene is made of, for those who send scenes to other processes.
SPEC_TYPES: tuple[type[Any], ...] = tuple(
    kind for kind in list(vars().values()) if isinstance(kind, type) and is_dataclass(kind)
)
