"""Draw bricks with OpenGL: front to back, with texels from an atlas, as exactly as the batch requires.

    pixel grid -> for each group of bricks: upload them, blend them "under" the image, mask saturated pixels in the
    depth buffer -> the next, finer grid, where neighbouring pixels differ -> read back

A group has as many bricks as the atlas has slots, or fewer, so that saturated pixels are masked now and then.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import moderngl
import numpy as np

from renderer.bricks import HALO, JITTER_PER_PX, BrickBatch
from renderer.draw.brick_cache import BrickCache, BrickView
from renderer.draw.constants import LARGE_FLOAT32, PIECES_IN_ROW
from renderer.draw.gl.atlas import GLAtlas
from renderer.draw.gl.programs import BRICK_VERTEX, vertex_content
from renderer.draw.subsampling import grid_size, upsample
from renderer.transfer import PiecewiseTransfer, toward_light
from renderer.view import View
from renderer.volume import Bools, Float32, UInt32

LoadProgram = Callable[[str, str], Any]  # from the files of the vertex and of the fragment shader
# Returns what a function makes for (width, height); raises RenderError for what is too large.
MakeTarget = Callable[[Callable[[tuple[int, int]], Any], tuple[int, int]], Any]

# Groups of bricks in an image without subsampling. Saturated pixels are masked between groups, which costs more than it
# saves where few pixels are drawn.
NUM_GROUPS = 4

SCALARS, MEANS, GUIDE, PIECES, IMAGE = range(5)  # texture units

# The error of a device's filter between equal scalars: a scalar on a step must stay on its upper side.
FILTER_ERROR = np.float32(2.0**-22)


class _PixelGrid(NamedTuple):
    """A grid of every `stride`-th pixel along both axes, as many as cover the image.

    size: columns and rows. target: draws the colours of `image` and depths. mask: draws the same depths only.
    """

    stride: int
    size: tuple[int, int]
    image: Any
    target: Any
    mask: Any


class GLBrickRenderer:
    """A rasteriser of bricks in a context, which frees what the cache does not."""

    def __init__(self, context: Any, load_program: LoadProgram, make_target: MakeTarget, num_threads: int) -> None:
        # Asked now: a lost context has no info.
        make_atlas = partial(GLAtlas, context, int(context.info["GL_MAX_3D_TEXTURE_SIZE"]))
        self.cache = BrickCache(make_atlas, make_atlas, num_threads)
        self._context, self._load_program, self._make_target = context, load_program, make_target
        self._pixel_grids: dict[int, _PixelGrid] = {}
        self._image_size = (0, 0)
        self._transfer: tuple[PiecewiseTransfer, list[Any]] | None = None

    def rasterize(self, batch: BrickBatch, order: UInt32, view: View) -> Float32:
        """Composite `batch[order]`, front to back: float32 [height, width, 4], premultiplied RGBA over nothing."""
        assert not view.clip, "only the loops of the processor clip anything away"
        self._update_resources(batch, view.size)
        brick_view = self.cache.begin_frame(batch, order, view)
        programs = self._prepare_programs(brick_view)
        vertices = np.column_stack([brick_view.rectangles_px, brick_view.boxes, np.zeros((len(order), 3))])
        vertices = vertices.astype(np.float32)  # BRICK_VERTEX; the places in the atlas are still missing
        coarse = None
        for stride in batch.screen_sampling.strides:
            grid = self._pixel_grid(stride)
            self._init_grid(grid, coarse, batch.screen_sampling.difference_threshold)
            self._draw_bricks(programs, brick_view, vertices, grid)
            coarse = grid
        assert coarse is not None
        pixels = np.empty((coarse.size[1], coarse.size[0], 4), np.float32)
        coarse.target.read_into(pixels, components=4, dtype="f4")
        return pixels if coarse.stride == 1 else upsample(pixels, coarse.stride, view.size, self.cache.threads)

    def _update_resources(self, batch: BrickBatch, size: tuple[int, int]) -> None:
        """Upload the transfer function, and drop the grids of another image size."""
        pieces = batch.bricks.pieces
        if self._transfer is None or self._transfer[0] is not pieces:
            self._transfer = pieces, [self._table(content) for content in _tables(pieces)]
        if self._image_size != size:
            self._pixel_grids, self._image_size = {}, size
            self._context.gc()

    def _table(self, content: Float32) -> Any:
        """Make a texture of float32 [rows, columns, channels]."""
        rows, columns, num_channels = content.shape
        texture = self._context.texture((columns, rows), num_channels, content, dtype="f4")
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return texture

    def _pixel_grid(self, stride: int) -> _PixelGrid:
        if stride not in self._pixel_grids:
            size = grid_size(self._image_size, stride)
            self._pixel_grids[stride] = self._make_target(partial(self._make_pixel_grid, stride), size)
        return self._pixel_grids[stride]

    def _make_pixel_grid(self, stride: int, size: tuple[int, int]) -> _PixelGrid:
        image = self._context.texture(size, 4, dtype="f4")
        depths = self._context.depth_renderbuffer(size)
        target = self._context.framebuffer([image], depths)
        mask = self._context.framebuffer([], depths)
        image.filter = moderngl.LINEAR, moderngl.LINEAR
        image.repeat_x = image.repeat_y = False
        return _PixelGrid(stride, size, image, target, mask)

    def _init_grid(self, grid: _PixelGrid, coarse: _PixelGrid | None, difference_threshold: float) -> None:
        """Clear a grid, or fill it from a coarser one where it is not drawn."""
        if coarse is None:
            grid.target.use()
            grid.target.depth_mask = True
            grid.target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
            return
        program = self._load_program("whole_vertex.glsl", "refined_fragment.glsl")
        program["shift"] = (coarse.stride // grid.stride).bit_length() - 1
        program["coarse"], program["difference_threshold"] = IMAGE, difference_threshold
        coarse.image.use(IMAGE)
        self._draw_depths(program, grid.target)

    def _prepare_programs(self, brick_view: BrickView) -> tuple[Any, Any]:
        """Return the programs of scalars and of means, with the uniforms of a batch and a view.

        There are two, because software renderers run all branches of a program for every pixel.
        """
        batch, rays = brick_view.batch, brick_view.rays
        look_up_scalars = "brick_pieces.glsl " + ("brick_lit.glsl" if batch.shading else "brick_plain.glsl")
        common = {
            "center_px": rays.center_px,
            "origins": tuple(rays.origins.T.ravel()),  # GL matrices are column by column
            "directions": tuple(rays.directions.T.ravel()),
            "slope_per_px": rays.slope_per_px,
            "start": max(rays.start, -LARGE_FLOAT32),
            "termination_alpha": batch.screen_sampling.termination_alpha,
            "jitter_per_px": JITTER_PER_PX,
            "spacings_per_model_unit": batch.spacings_per_model_unit,
        }
        of_scalars: dict[str, Any] = {"atlas": SCALARS, "guide": GUIDE, "pieces": PIECES}
        if batch.shading:
            of_scalars["light"] = tuple(toward_light(batch.shading))
            of_scalars["ambient_diffuse"] = batch.shading.ambient, batch.shading.diffuse
        programs = []
        of_means = {"atlas": MEANS}
        for look_up, uniforms in ((look_up_scalars, of_scalars), ("brick_means.glsl", of_means)):
            program = self._load_program("brick_vertex.glsl", f"opacity.glsl {look_up} brick_fragment.glsl")
            for name, value in (common | uniforms).items():
                program[name] = value
            programs.append(program)
        assert self._transfer is not None
        for texture, unit in zip(self._transfer[1], (GUIDE, PIECES), strict=True):
            texture.use(unit)
        return programs[0], programs[1]

    def _draw_bricks(
        self, programs: tuple[Any, Any], brick_view: BrickView, vertices: Float32, grid: _PixelGrid
    ) -> None:
        """Draw groups of bricks, each group behind those before."""
        for program in programs:
            program["stride_px"], program["grid_size"] = grid.stride, grid.size
        screen_sampling, num = brick_view.batch.screen_sampling, len(brick_view.order)
        num_groups = NUM_GROUPS if screen_sampling.strides == (1,) else 1
        for group, uploaded in self.cache.upload_groups(brick_view, -(-num // num_groups)):
            for program, unit, (atlas, numbers, slots) in zip(programs, (SCALARS, MEANS), uploaded, strict=True):
                if len(numbers):
                    vertices[numbers, -3:] = atlas.corners(slots) + HALO
                    atlas.texture.use(unit)
                    program["atlas_scale"] = tuple(1 / n for n in atlas.size)
            grid.target.use()
            grid.target.depth_mask = False
            self._context.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST)
            self._context.blend_func = moderngl.ONE_MINUS_DST_ALPHA, moderngl.ONE
            self._context.depth_func = "<"
            self._draw_group(programs, brick_view.is_mean[group], vertices[group])
            if screen_sampling.termination_transmittance > 0 and num_groups > 1 and group.stop < num:
                self._mask_saturated(grid, screen_sampling.termination_transmittance)

    def _draw_group(self, programs: tuple[Any, Any], is_mean: Bools, vertices: Float32) -> None:
        """Draw bricks, each a quad of two triangles over its rectangle, in runs of one kind."""
        content = [vertex_content(self._context.buffer(np.repeat(vertices, 6, axis=0)), BRICK_VERTEX)]
        arrays = [self._context.vertex_array(program, content) for program in programs]
        ends = np.flatnonzero(is_mean[1:] != is_mean[:-1]) + 1
        for first, end in pairwise([0, *ends.tolist(), len(vertices)]):
            arrays[int(is_mean[first])].render(moderngl.TRIANGLES, vertices=6 * (end - first), first=6 * first)

    def _mask_saturated(self, grid: _PixelGrid, termination_transmittance: float) -> None:
        """Write a near depth at pixels that are almost opaque: later bricks do not draw them."""
        program = self._load_program("whole_vertex.glsl", "saturated_fragment.glsl")
        program["image"], program["termination_transmittance"] = IMAGE, termination_transmittance
        grid.image.use(IMAGE)
        self._draw_depths(program, grid.mask)

    def _draw_depths(self, program: Any, target: Any) -> None:
        """Draw all pixels of a target with the depths that the program writes."""
        target.use()
        target.depth_mask = True
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "1"
        self._context.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)


def _tables(pieces: PiecewiseTransfer) -> tuple[Float32, Float32]:
    """Return guide and pieces as brick_pieces.glsl reads them, float32 [rows, columns, channels]."""
    num_rows = -(-len(pieces.rows) // PIECES_IN_ROW)
    rows = np.zeros((num_rows, 3, PIECES_IN_ROW, 4), np.float32)
    row, column = np.divmod(np.arange(len(pieces.rows)), PIECES_IN_ROW)
    rows[row, 0, column], rows[row, 1, column] = pieces.rows[:, 4:8], pieces.rows[:, 8:]
    rows[row, 2, column, 0] = np.minimum(pieces.rows[:, 0] - FILTER_ERROR, np.float32(LARGE_FLOAT32))
    rows[row, 2, column, 1] = pieces.rows[:, 1]
    return pieces.guide.astype(np.float32)[None, :, None], rows.reshape(3 * num_rows, PIECES_IN_ROW, 4)
