"""Draw one frame, step by step, from the stage of a film and a level of detail to 8 bits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from renderer.draw import Lines, Rasterizer, draw_lines
from renderer.film import Pixels, over_background, quantize
from renderer.frame.primitives import LOD, Orders
from renderer.frame.stage import Stage, Stopwatch, view_of
from renderer.kernels import ThreadPool
from renderer.layers import Layer
from renderer.modes import chord_lengths
from renderer.scene import TimeBudget
from renderer.view import View
from renderer.volume import Float32, Float64

# The name of the step that uploads bricks missing in the cache, which later frames use, too.
UPLOAD_STEP = "bricks"


@dataclass(frozen=True)
class DrawList:
    """The splats or bricks to draw on a frame: a level of detail, sorted for the frame's view.

    orders: the indices of the elements of each batch in draw order, once or in several orders that are blended.
    order_seconds: the time that sorting took.
    """

    stage: Stage
    number: int
    lod: LOD
    view: View
    orders: Orders
    order_seconds: float

    @property
    def typical_seconds(self) -> float:
        """Return the time to draw the frame, in all its orders, on a typical machine."""
        return self.lod.typical_seconds(self.orders, self.view)

    def upload(self, rasterizer: Rasterizer) -> bool:
        """Prepare the rasteriser for this frame and similar ones; return whether there was something to do."""
        # The first order is enough: every order has the same elements.
        return rasterizer.upload(self.lod.batches, self.orders[0][1], self.view)


@dataclass(frozen=True)
class Frame:
    """A finished frame.

    image: the pixels, of the kind of the first output, as `quantize` returns them.
    radiance: float32 [height, width, 4], premultiplied RGBA without background, from which the image was made. It is
        linear light if the scene has `light`.
    num_cells: the number of cells, or bricks, in the cut. num_primitives: the number of cells that the frame can show.
    rays_per_pixel: the rays drawn, divided by the pixels of the picture; None for splats.
    seconds: the time that each step took. stage, view: the stage and the view from which it was drawn.
    lines: the lines of the annotation, along the edges of cells and of volumes.
    predicted_seconds: the time predicted for the whole frame; None without a budget.
    """

    number: int
    image: Pixels
    radiance: Float32
    tolerance: float
    num_cells: int
    num_primitives: int
    rays_per_pixel: float | None
    seconds: dict[str, float]
    stage: Stage
    view: View
    lines: tuple[Lines, ...] = ()
    predicted_seconds: float | None = None

    @property
    def unrounded(self) -> Float64:
        """Return the picture before it is rounded, as metrics compare it: float64 [height, width, 3]."""
        scene = self.stage.scene
        return over_background(self.radiance, scene.background, is_linear=scene.light is not None)

    def radiance_with_lines(self) -> Float32:
        """Return the radiance with the lines drawn over it, or the radiance itself if there are no lines."""
        image = self.radiance.copy() if self.lines else self.radiance
        for lines in self.lines:
            draw_lines(lines, self.view, image, is_linear=self.stage.scene.light is not None)
        return image


def make_draw_list(stage: Stage, lod: LOD, number: int, watch: Stopwatch) -> DrawList:
    """Sort a level of detail for the view of a frame. stage: the stage of the frame."""
    view = view_of(stage, number)
    return DrawList(stage, number, lod, view, lod.orders(view), watch.lap("order"))


def draw_frame(draw_list: DrawList, rasterizer: Rasterizer, watch: Stopwatch) -> Frame:
    """Draw a frame. Raises InputError if the volume's file was changed."""
    lod, stage = draw_list.lod, draw_list.stage
    stage.require_unchanged()
    num_rays_before = rasterizer.num_rays
    # A film with a time for each frame makes all missing bricks first: later frames of the cut do not need that time.
    if isinstance(stage.scene.error.goal, TimeBudget) and draw_list.upload(rasterizer):
        watch.lap(UPLOAD_STEP)
    is_projection = stage.scene.mode.is_projection
    image = _add_projections(draw_list, rasterizer) if is_projection else _blend_orders(draw_list, rasterizer)
    watch.lap("draw")
    pixels = quantize(
        image, stage.scene.background, stage.scene.output.kind.depth, is_linear=stage.scene.light is not None
    )
    stage.require_unchanged()  # the file may have changed while the frame was drawn
    watch.lap("quantize")
    num_rays = rasterizer.num_rays - num_rays_before
    return Frame(
        number=draw_list.number,
        image=pixels,
        radiance=image,
        tolerance=lod.tolerance,
        num_cells=lod.num_cells,
        num_primitives=sum(map(len, draw_list.orders[0][1])),
        rays_per_pixel=None if stage.scene.needs_opengl else num_rays / math.prod(draw_list.view.size),
        seconds=dict(watch.seconds),
        stage=stage,
        view=draw_list.view,
        lines=tuple(lod.lines),
    )


def _blend_orders(draw_list: DrawList, rasterizer: Rasterizer) -> Float32:
    """Draw every order, and add the pictures, multiplied by their shares. Nearly all views have one order."""
    batches, view = draw_list.lod.batches, draw_list.view
    (share, order), *others = draw_list.orders
    image = rasterizer.rasterize(batches, order, view)
    if others:
        image *= share
    for share, order in others:
        image += share * rasterizer.rasterize(batches, order, view)
    return image


def _add_projections(draw_list: DrawList, rasterizer: Rasterizer) -> Float32:
    """Draw each layer by itself, and add the pictures of their projections, multiplied by the layers' weights."""
    stage, view, image = draw_list.stage, draw_list.view, None
    for group, batch, order in zip(stage.groups, draw_list.lod.batches, draw_list.orders[0][1], strict=True):
        (layer,) = group.layers
        assert layer.projection is not None
        picture = rasterizer.rasterize(
            [batch], [order], view, partial(_color_projection, layer, view, rasterizer.threads)
        )
        if len(stage.groups) > 1:
            picture *= (layer.spec.weight, layer.spec.weight, layer.spec.weight, 1.0)
        image = picture if image is None else image + picture
    assert image is not None
    image[..., 3] = np.minimum(image[..., 3], np.float32(1))
    return image


def _color_projection(
    layer: Layer, view: View, threads: ThreadPool, gathered: Float32, positions_px: Float64 | None
) -> Float32:
    """Return the colours of a projection for rays or a whole picture. gathered, positions_px: as in `RayColors`."""
    assert layer.projection is not None
    chords = chord_lengths(layer.volume, view, layer.spec.clip, positions_px, threads)
    if positions_px is None:
        return layer.projection.picture(gathered, chords, threads)
    return layer.projection.picture(gathered[:, None], chords[:, None], threads)[:, 0]
