"""The program's table of contents: from a scene to its frames, and the only frame loop.

Scene -> Volume -> Pyramid -> (per frame: View, tolerance) -> Cut -> SplatBatch -> float image -> 8 bits
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from renderer.camera import View
from renderer.camera_paths import axes_in_runs, make_view
from renderer.cell_edges import CellEdges, make_cell_edges
from renderer.depth_directions import Turning, make_turning
from renderer.extents import Extent, camera_problems, require_proportion, volume_problems
from renderer.framing import finest_useful_level, fit_distance, visible_centre, visible_points
from renderer.octree import Cut, cut_pyramid
from renderer.projection import visible_orders
from renderer.pyramid import Pyramid, build_pyramid
from renderer.quantize import quantize
from renderer.readers import read_volume
from renderer.scene import Scene, Vector
from renderer.schedule import least_tolerance, tolerance_at
from renderer.splats import SplatBatch, make_splats
from renderer.transfer import make_transfer
from renderer.volume import Float64, Volume

Clock = Callable[[], float]


class Rasterizer(Protocol):
    """What draws sorted splats, and lines if the scene asks: `renderer.raster_gl.GLRasterizer`, or a stand-in."""

    def rasterize(self, batch: SplatBatch, order: npt.NDArray[np.uint32], view: View) -> npt.NDArray[np.float32]: ...

    def rasterize_edges(self, edges: CellEdges, view: View) -> npt.NDArray[np.float32]: ...


@dataclass(frozen=True)
class Stage:
    """Everything of a film that does not change from frame to frame.

    target: world position that the camera looks at.
    distance: of the eye from it, world units.
    finest_level: cells of lower levels would be too small to see on every frame.
    turning: which neighbours change their order on the way.
    seconds: what it took, by stage.
    """

    scene: Scene
    volume: Volume
    pyramid: Pyramid
    target: Vector
    distance: float
    finest_level: int
    turning: Turning
    seconds: dict[str, float]


@dataclass(frozen=True)
class Frame:
    """One finished frame.

    image: uint8 [height, width, 3], or 4 with straight alpha where the background is transparent.
    radiance: float32 [height, width, 4], premultiplied RGBA over nothing, from which the image was made.
    num_cells: cells in the cut; num_splats: those of them that the frame can show.
    seconds: what it took, by stage.
    """

    number: int
    image: npt.NDArray[np.uint8]
    radiance: npt.NDArray[np.float32]
    tolerance: float
    num_cells: int
    num_splats: int
    seconds: dict[str, float]


class Stopwatch:
    """Seconds between laps, by name; renderer/ has no clock of its own."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._last = clock, clock()
        self.seconds: dict[str, float] = {}

    def lap(self, name: str) -> None:
        """Book the time since the lap before under `name`."""
        now = self._clock()
        self.seconds[name] = self.seconds.get(name, 0.0) + now - self._last
        self._last = now


def prepare(
    scene: Scene, *, clock: Clock, num_threads: int, volume: Volume | None = None, any_tolerance: bool = False
) -> Stage:
    """Read the volume, build the pyramid, frame what is visible. Raises InputError for a volume that cannot be used.

    A `volume` that is given is drawn in place of the scene's, which is then not read. The pyramid has what the scene's
    schedule can ask for; with `any_tolerance` it serves every tolerance and level.
    """
    watch, camera, size = Stopwatch(clock), scene.camera, scene.output.size
    volume = read_volume(scene.volume) if volume is None else volume
    extent = _extent(volume)
    require_proportion([*volume_problems(extent, volume.name), *camera_problems(camera, size, extent)])
    watch.lap("read")
    transfer = make_transfer(scene.transfer_function, volume.finest_spacing)
    pyramid = build_pyramid(
        volume,
        transfer,
        spec=scene.pyramid,
        error=scene.error,
        shading=scene.shading,
        num_threads=num_threads,
        least_tolerance=0.0 if any_tolerance else least_tolerance(scene.error),
        finest_level=0 if any_tolerance else scene.error.finest_level,
    )
    watch.lap("pyramid")
    points = visible_points(pyramid)
    target, distance = _framing(scene, volume, points)
    require_proportion(camera_problems(replace(camera, target=target, distance=distance), size, extent))
    finest_level = finest_useful_level(volume, points, camera, target, distance, size)
    turning = make_turning(volume.world_from_index, axes_in_runs(camera.path))
    watch.lap("framing")
    return Stage(scene, volume, pyramid, target, distance, finest_level, turning, watch.seconds)


def view_of(stage: Stage, frame: int) -> View:
    """The view of a frame of the film."""
    return make_view(stage.scene.camera, frame, stage.target, stage.distance, stage.scene.output.size)


def finest_level_at(stage: Stage, tolerance: float) -> int:
    """The finest level that is drawn at a tolerance."""
    return max(stage.scene.error.finest_level, stage.finest_level if tolerance > 0 else 0)


def render_frames(stage: Stage, frames: Sequence[int], rasterizer: Rasterizer, *, clock: Clock) -> Iterator[Frame]:
    """Draw these frames of the film, in this order. A cut and its splats are used again while the tolerance stays."""
    scene = stage.scene
    tolerance, splats, lattice, edges = -1.0, None, None, None
    for number in frames:
        watch = Stopwatch(clock)
        if splats is None or lattice is None or tolerance_at(scene.error, number) != tolerance:
            splats = lattice = edges = None  # let go of the old ones first
            tolerance = tolerance_at(scene.error, number)
            cut = cut_pyramid(stage.pyramid, tolerance, finest_level=finest_level_at(stage, tolerance))
            watch.lap("cut")
            splats = make_splats(cut, scene.splat)
            watch.lap("splats")
            if scene.overlay == "octree":
                edges = make_cell_edges(cut)
                watch.lap("overlay")
            lattice = cut if scene.splat.order == "boxes" else cut.without_cells()  # nothing else needs them again
            del cut
        yield _draw(stage, number, tolerance, splats, lattice, edges, rasterizer, watch)


def _draw(
    stage: Stage,
    number: int,
    tolerance: float,
    splats: SplatBatch,
    lattice: Cut,
    edges: CellEdges | None,
    rasterizer: Rasterizer,
    watch: Stopwatch,
) -> Frame:
    scene = stage.scene
    view = view_of(stage, number)
    orders = visible_orders(splats, lattice, view, scene.splat.order, stage.turning)
    watch.lap("order")
    image = _mixture(splats, orders, view, rasterizer)
    watch.lap("draw")
    if edges is not None:
        lines = rasterizer.rasterize_edges(edges, view)
        image *= 1 - lines[..., 3:]
        image += lines
        watch.lap("overlay")
    pixels = quantize(image, scene.output.background)
    watch.lap("quantize")
    return Frame(number, pixels, image, tolerance, len(splats), len(orders[0][1]), watch.seconds)


def _mixture(
    splats: SplatBatch, orders: Sequence[tuple[float, npt.NDArray[np.uint32]]], view: View, rasterizer: Rasterizer
) -> npt.NDArray[np.float32]:
    """The picture: for nearly all views that of the only order, else each order's with its share."""
    (share, order), *others = orders
    image = rasterizer.rasterize(splats, order, view)
    if others:
        image *= share
    for share, order in others:
        image += share * rasterizer.rasterize(splats, order, view)
    return image


def _extent(volume: Volume) -> Extent:
    x, y, z = volume.spacing.tolist()
    centre_x, centre_y, centre_z = volume.centre.tolist()
    return Extent.of(volume.shape_xyz, (x, y, z), (centre_x, centre_y, centre_z))


def _framing(scene: Scene, volume: Volume, points: Float64) -> tuple[Vector, float]:
    """Target and distance: as the scene says, or such that the whole path has all that is visible in frame."""
    camera = scene.camera
    if camera.target == "visible":
        target = visible_centre(points)
    elif camera.target is None:
        x, y, z = volume.centre
        target = float(x), float(y), float(z)
    else:
        target = camera.target
    if camera.distance is not None:
        return target, camera.distance
    return target, fit_distance(camera, points, target, scene.output.size, range(camera.path.frames))
