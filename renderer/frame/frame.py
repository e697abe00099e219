"""One frame: from the stage of a film and a tolerance to 8 bits, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickBatch, Bricks
from renderer.draw import CellEdges
from renderer.film import quantize
from renderer.frame.brick_primitive import BrickPrimitive
from renderer.frame.primitives import LOD, Orders, Primitive
from renderer.frame.splat_primitive import SplatPrimitive
from renderer.pyramid import Pyramid
from renderer.scene import Scene, Vector
from renderer.splats import SplatBatch
from renderer.view import OrderBlending, View, make_view
from renderer.volume import Volume

Clock = Callable[[], float]

# What a frame does for those after it, too: bricks that were not on the device. Other frames have no such lap.
UPLOAD_STAGE = "bricks"


class Rasterizer(Protocol):
    """What draws sorted splats or bricks, and lines if asked: `renderer.draw.gl.raster.GLRasterizer`, or a stand-in.

    bring: what the picture shares with later ones to where it is drawn; whether any of it was not there. A picture that
    was not brought is the same.
    """

    def upload(self, batch: SplatBatch | BrickBatch, order: npt.NDArray[np.uint32], view: View) -> bool: ...

    def rasterize(
        self, batch: SplatBatch | BrickBatch, order: npt.NDArray[np.uint32], view: View
    ) -> npt.NDArray[np.float32]: ...

    def rasterize_edges(self, edges: CellEdges, view: View) -> npt.NDArray[np.float32]: ...


@dataclass(frozen=True)
class Stage:
    """Everything of a film that does not change from frame to frame.

    target: world position that the camera looks at.
    distance: of the eye from it, world units.
    finest_level: cells of lower levels would be too small to see on every frame.
    voxel_px: the finest spacing at the volume's centre, in pixels, where it is smallest on the way.
    turning: which neighbours change their order on the way.
    bricks: of the volume, where that is what the footprint is drawn from.
    seconds: what it took, by stage.
    """

    scene: Scene
    volume: Volume
    pyramid: Pyramid
    target: Vector
    distance: float
    finest_level: int
    voxel_px: float
    turning: OrderBlending
    bricks: Bricks | None
    seconds: dict[str, float]


class Stopwatch:
    """Seconds between laps, by name; renderer/ has no clock of its own."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._last = clock, clock()
        self.seconds: dict[str, float] = {}

    def lap(self, name: str) -> float:
        """Book the time since the lap before under `name`; it is returned, too."""
        now = self._clock()
        seconds, self._last = now - self._last, now
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        return seconds


@dataclass(frozen=True)
class DrawList:
    """A detail seen on a frame: `orders` are those of its splats. order_seconds: what finding them took."""

    number: int
    lod: LOD
    view: View
    orders: Orders
    order_seconds: float


@dataclass(frozen=True)
class Frame:
    """One finished frame.

    image: uint8 [height, width, 3], or 4 with straight alpha where the background is transparent.
    radiance: float32 [height, width, 4], premultiplied RGBA over nothing, from which the image was made.
    num_cells: cells, or bricks, in the cut; num_splats: those of them that the frame can show.
    seconds: what it took, by stage.
    predicted_seconds: what it was to take from start to end, where there is a budget.
    """

    number: int
    image: npt.NDArray[np.uint8]
    radiance: npt.NDArray[np.float32]
    tolerance: float
    num_cells: int
    num_splats: int
    seconds: dict[str, float]
    predicted_seconds: float | None = None


def view_of(stage: Stage, frame: int) -> View:
    """The view of a frame of the film."""
    return make_view(stage.scene.camera, frame, stage.target, stage.distance, stage.scene.output.size)


def finest_level_at(stage: Stage, tolerance: float) -> int:
    """The finest level that is drawn at a tolerance."""
    return max(stage.scene.error.finest_level, stage.finest_level if tolerance > 0 else 0)


def make_primitive(stage: Stage) -> Primitive:
    """Of the scene's footprint."""
    scene = stage.scene
    levels = {
        "finest_level": finest_level_at(stage, tolerance=1.0),
        "finest_level_at_zero": finest_level_at(stage, tolerance=0.0),
    }
    with_edges = scene.overlay == "octree"
    if stage.bricks is None:
        return SplatPrimitive(stage.pyramid, scene.splat, stage.turning, **levels, with_edges=with_edges)
    low, high = stage.bricks.volume_range
    largest_change = high - low if scene.error.of == "scalar" and high > low else 1.0
    return BrickPrimitive(
        stage.bricks,
        scene.shading,
        **levels,
        voxel_px=stage.voxel_px,
        largest_change=largest_change,
        with_edges=with_edges,
    )


def make_lod(stage: Stage, tolerance: float, watch: Stopwatch) -> LOD:
    """What is drawn of a stage at a tolerance."""
    return make_primitive(stage).make_lod(tolerance, watch.lap)


def make_draw_list(stage: Stage, lod: LOD, number: int, watch: Stopwatch) -> DrawList:
    """See a detail from where the camera is on a frame."""
    view = view_of(stage, number)
    return DrawList(number, lod, view, lod.orders(view), watch.lap("order"))


def upload(draw_list: DrawList, rasterizer: Rasterizer) -> bool:
    """Make the rasteriser ready for a frame and those like it; whether there was something to do."""
    return rasterizer.upload(
        draw_list.lod.splats, draw_list.orders[0][1], draw_list.view
    )  # the same splats in each order


def draw_frame(stage: Stage, draw_list: DrawList, rasterizer: Rasterizer, watch: Stopwatch) -> Frame:
    """The finished frame. Raises InputError where the volume's file was changed."""
    lod = draw_list.lod
    stage.volume.require_unchanged()
    if upload(draw_list, rasterizer):
        watch.lap(UPLOAD_STAGE)
    image = _blend_orders(draw_list, rasterizer)
    watch.lap("draw")
    if lod.edges is not None:
        lines = rasterizer.rasterize_edges(lod.edges, draw_list.view)
        image *= 1 - lines[..., 3:]
        image += lines
        watch.lap("overlay")
    pixels = quantize(image, stage.scene.output.background)
    stage.volume.require_unchanged()  # while it was drawn, too
    watch.lap("quantize")
    num_splats = len(draw_list.orders[0][1])
    return Frame(draw_list.number, pixels, image, lod.tolerance, lod.num_cells, num_splats, dict(watch.seconds))


def _blend_orders(draw_list: DrawList, rasterizer: Rasterizer) -> npt.NDArray[np.float32]:
    """The picture: for nearly all views that of the only order, else each order's with its share."""
    (share, order), *others = draw_list.orders
    image = rasterizer.rasterize(draw_list.lod.splats, order, draw_list.view)
    if others:
        image *= share
    for share, order in others:
        image += share * rasterizer.rasterize(draw_list.lod.splats, order, draw_list.view)
    return image
