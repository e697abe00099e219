"""Bricks drawn with OpenGL: boxes front to back, their texels from an atlas, as exact as the batch asks for.

    lattice of nodes -> for each group of bricks: texels into the atlas, boxes blended "under", what is opaque by then
    masked in the depth buffer -> the next, finer lattice, where the nodes differ -> read back

A group is as many bricks as the atlas holds, or fewer so that one looks now and then which pixels are opaque.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from renderer.bricks import DITHER, HALO, JITTER_PER_PX, BrickBatch
from renderer.draw.brick_store import BrickCache
from renderer.draw.brick_view import BrickView
from renderer.draw.gl.atlas import GLAtlas
from renderer.draw.subsampling import interpolated, num_nodes
from renderer.threads import ThreadPool
from renderer.transfer import PiecewiseTransfer, toward_light
from renderer.view import View, ray_setup

Image = npt.NDArray[np.float32]
Programs = Callable[[str, str], Any]

# Parts of a picture, all of whose pixels are drawn, between which one looks for those that are opaque by then: a look
# costs more than it saves where few pixels are drawn.
NUM_GROUPS = 4

SCALARS, MEANS, GUIDE, PIECES, IMAGE, REFINEMENT = range(6)  # texture units

# Of the transfer function in a texture's row, as in brick_pieces.glsl.
PIECES_IN_ROW = 1024
# What filters of devices may take from a scalar between equal ones: one on a step must stay on its upper side.
FILTER_ERROR = np.float32(2.0**-22)

# Stands for infinity where float32 is wanted.
LARGEST = 1e30


VERTEX = np.dtype(
    [("rectangle_px", "f4", 4), ("box_low", "f4", 3), ("box_high", "f4", 3), ("first_corner", "f4", 3),
     ("first_texel", "f4", 3), ("steps", "f4", 2)]
)  # fmt: skip
VERTEX_FORMAT = "4f 3f 3f 3f 3f 2f"


@dataclass(frozen=True)
class _PixelGrid:
    """Nodes at every `stride`-th pixel, as many as cover the image.

    target: colours, which are in `image`, and depths; mask: only depths. differing: a mark for each block.
    """

    stride: int
    size: tuple[int, int]
    image: Any
    target: Any
    mask: Any
    refinement_mask: Any

    def release(self) -> None:
        """Give back all that it has on the device."""
        for thing in (
            self.mask, self.target.depth_attachment, self.target, self.image,
            self.refinement_mask.color_attachments[0], self.refinement_mask,
        ):  # fmt: skip
            thing.release()


class GLBrickRenderer:
    """Draws in a context that is given; what lives there is kept for the next picture. num_threads: for what is done
    beforehand, and afterwards. `release` ends them."""

    def __init__(self, context: Any, programs: Programs, largest_point_px: float, num_threads: int) -> None:
        self._context, self._programs, self._largest_point_px = context, programs, largest_point_px
        self._threads = ThreadPool(num_threads)
        self._pixel_grids: dict[int, _PixelGrid] = {}
        self._image_size = (0, 0)
        self._store = BrickCache(partial(GLAtlas, context), partial(GLAtlas, context), self._threads)
        self._transfer: tuple[PiecewiseTransfer, list[Any]] | None = None

    def upload(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> bool:
        """Bring those bricks of `batch[order]` to the device that are not there; whether there were any."""
        return self._store.upload(batch, order, view)

    def draw(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> Image:
        """Composite `batch[order]`, front to back: float32 [height, width, 4], premultiplied RGBA over nothing."""
        self._look_at(batch, view.size)
        picture = self._store.begin(batch, order, view)
        self._store.begin_frame(picture)
        programs, vertices = self._prepared(batch, view), _vertices(picture)
        coarse = None
        for stride in batch.screen_sampling.strides:
            lattice = self._pixel_grid(stride)
            self._init_grid(lattice, coarse, batch.screen_sampling.difference_threshold)
            self._draw_boxes(programs, picture, vertices, lattice)
            coarse = lattice
        assert coarse is not None
        nodes = np.empty((coarse.size[1], coarse.size[0], 4), np.float32)
        coarse.target.read_into(nodes, components=4, dtype="f4")
        return nodes if coarse.stride == 1 else interpolated(nodes, coarse.stride, view.size, self._threads)

    def forget(self) -> None:
        """Let go of bricks, on the device and here."""
        self._store.forget()

    def release(self) -> None:
        """Let go of bricks, and end the threads; all else goes with the context."""
        self.forget()
        self._threads.release()

    def _look_at(self, batch: BrickBatch, size: tuple[int, int]) -> None:
        """Bring the transfer function, and let go of what belongs to pictures of another size."""
        if self._transfer is None or self._transfer[0] is not batch.bricks.pieces:
            for texture in self._transfer[1] if self._transfer is not None else ():
                texture.release()
            self._transfer = None
            pieces = batch.bricks.pieces
            self._transfer = pieces, [self._table(content) for content in _tables(pieces)]
        if self._image_size != size:
            for lattice in self._pixel_grids.values():
                lattice.release()
            self._pixel_grids, self._image_size = {}, size

    def _table(self, content: npt.NDArray[np.float32]) -> Any:
        """A texture of float32 [rows, columns, channels]."""
        rows, columns, num_channels = content.shape
        texture = self._context.texture((columns, rows), num_channels, content, dtype="f4")
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return texture

    def _pixel_grid(self, stride: int) -> _PixelGrid:
        if stride not in self._pixel_grids:
            width, height = num_nodes(self._image_size, stride)
            image = self._context.texture((width, height), 4, dtype="f4")
            depths = self._context.depth_renderbuffer((width, height))
            target = self._context.framebuffer([image], depths)
            mask = self._context.framebuffer([], depths)
            image.filter = moderngl.LINEAR, moderngl.LINEAR
            image.repeat_x = image.repeat_y = False
            refinement_mask = self._context.framebuffer([self._context.texture((width, height), 1)])
            _ = self._context.error  # moderngl binds the target before once more, which may be gone
            self._pixel_grids[stride] = _PixelGrid(stride, (width, height), image, target, mask, refinement_mask)
        return self._pixel_grids[stride]

    def _init_grid(self, lattice: _PixelGrid, coarse: _PixelGrid | None, spread: float) -> None:
        """Clear a lattice, or fill it from a coarser one but for what is to be drawn."""
        if coarse is None:
            lattice.target.use()
            lattice.target.depth_mask = True
            lattice.target.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
            return
        self._mark_refinement(coarse, spread)
        program = self._programs("whole_vertex.glsl", "refined_fragment.glsl")
        program["shift"] = (coarse.stride // lattice.stride).bit_length() - 1
        program["coarse"], program["refinement_mask"] = IMAGE, REFINEMENT
        coarse.image.use(IMAGE)
        coarse.refinement_mask.color_attachments[0].use(REFINEMENT)
        lattice.target.use()
        lattice.target.depth_mask = True
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "1"
        self._draw_fullscreen(program)

    def _mark_refinement(self, lattice: _PixelGrid, spread: float) -> None:
        """Note which blocks of a lattice are not to be interpolated."""
        program = self._programs("whole_vertex.glsl", "differing_fragment.glsl")
        program["image"], program["spread"] = IMAGE, spread
        lattice.image.use(IMAGE)
        lattice.refinement_mask.use()
        self._context.enable_only(moderngl.NOTHING)
        self._draw_fullscreen(program)

    def _prepared(self, batch: BrickBatch, view: View) -> tuple[Any, Any]:
        """The programs of scalars and of means, with what is the same for a batch and a view.

        There are two, for software renderers go through what either needs for all pixels of a program that has both.
        """
        look_up_scalars = "brick_pieces.glsl " + ("brick_lit.glsl" if batch.shading else "brick_plain.glsl")
        rays = ray_setup(batch.cut.volume, batch.model_unit, view)
        common = {
            "center_px": tuple(n / 2 for n in view.size),
            "origins": tuple(rays.origins.T.ravel()),  # GL matrices are column by column
            "directions": tuple(rays.directions.T.ravel()),
            "slope_per_px": rays.slope_per_px,
            "start": max(rays.start, -LARGEST),
            "opaque": batch.screen_sampling.termination_alpha,
            "jitter_per_px": JITTER_PER_PX,
            "dither": DITHER,
            "spacings_per_model_unit": batch.spacings_per_model_unit,
        }
        of_scalars: dict[str, Any] = {"atlas": SCALARS, "guide": GUIDE, "pieces": PIECES}
        if batch.shading:
            of_scalars["light"] = tuple(toward_light(batch.shading))
            of_scalars["ambient_diffuse"] = batch.shading.ambient, batch.shading.diffuse
        programs = []
        of_means = {"atlas": MEANS}
        for look_up, uniforms in ((look_up_scalars, of_scalars), ("brick_means.glsl", of_means)):
            program = self._programs("brick_vertex.glsl", f"opacity.glsl {look_up} brick_fragment.glsl")
            for name, value in (common | uniforms).items():
                program[name] = value
            programs.append(program)
        assert self._transfer is not None
        for texture, unit in zip(self._transfer[1], (GUIDE, PIECES), strict=True):
            texture.use(unit)
        return programs[0], programs[1]

    def _draw_boxes(
        self, programs: tuple[Any, Any], picture: BrickView, vertices: npt.NDArray[Any], lattice: _PixelGrid
    ) -> None:
        """Group by group, each behind what has been drawn before."""
        for program in programs:
            program["stride_px"], program["num_nodes"] = lattice.stride, lattice.size
        screen_sampling, num = picture.batch.screen_sampling, len(picture.order)
        num_groups = NUM_GROUPS if screen_sampling.strides == (1,) else 1
        most, start = -(-num // num_groups), 0
        while start < num:
            end = self._store.end_of_group(picture, start, most)
            self._place(programs, picture, vertices, slice(start, end))
            lattice.target.use()
            lattice.target.depth_mask = False
            self._context.enable_only(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.PROGRAM_POINT_SIZE)
            self._context.blend_func = moderngl.ONE_MINUS_DST_ALPHA, moderngl.ONE
            self._context.depth_func = "<"
            self._draw_group(programs, picture.is_mean[start:end], vertices[start:end], lattice.stride)
            if screen_sampling.termination_transmittance > 0 and num_groups > 1 and end < num:
                self._mask_saturated(lattice, screen_sampling.termination_transmittance)
            start = end

    def _place(self, programs: tuple[Any, Any], picture: BrickView, vertices: npt.NDArray[Any], group: slice) -> None:
        """Bring bricks to the device, and tell the vertices where they are."""
        keys, kinds = picture.keys[group], self._store.kinds(picture)
        for program, unit, (atlas, is_chosen, texels) in zip(programs, (SCALARS, MEANS), kinds, strict=True):
            chosen = is_chosen[group]
            if not chosen.any():
                continue
            corners = atlas.corners(atlas.place(keys[chosen], texels))
            vertices["first_texel"][np.flatnonzero(chosen) + group.start] = corners + HALO
            atlas.texture.use(unit)
            program["atlas_scale"] = tuple(1 / n for n in atlas.size)

    def _draw_group(
        self, programs: tuple[Any, Any], is_mean: npt.NDArray[np.bool_], vertices: npt.NDArray[Any], stride: int
    ) -> None:
        """Boxes as points, or as quads where one of them is larger than the driver's points; run by run of a kind."""
        sides = vertices["rectangle_px"][:, 2:] - vertices["rectangle_px"][:, :2]
        quads = float(sides.max(initial=0.0)) / stride + 4 > self._largest_point_px
        for program in programs:
            program["quads"] = quads
        mode, each = (moderngl.TRIANGLES, 6) if quads else (moderngl.POINTS, 1)
        buffer = self._context.buffer(np.repeat(vertices, each))
        content = [(buffer, VERTEX_FORMAT, *(VERTEX.names or ()))]
        boxes = [self._context.vertex_array(program, content) for program in programs]
        ends = np.flatnonzero(is_mean[1:] != is_mean[:-1]) + 1
        for first, end in pairwise([0, *ends.tolist(), len(vertices)]):
            boxes[int(is_mean[first])].render(mode, vertices=each * (end - first), first=each * first)
        for thing in (*boxes, buffer):
            thing.release()

    def _mask_saturated(self, lattice: _PixelGrid, least: float) -> None:
        """Bring pixels that are opaque, or nearly so, to the front in the depth buffer: they are drawn no more."""
        program = self._programs("whole_vertex.glsl", "saturated_fragment.glsl")
        program["image"], program["termination_transmittance"] = IMAGE, least
        lattice.image.use(IMAGE)
        lattice.mask.use()
        lattice.mask.depth_mask = True
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "1"
        self._draw_fullscreen(program)

    def _draw_fullscreen(self, program: Any) -> None:
        triangle = self._context.vertex_array(program, [])
        triangle.render(moderngl.TRIANGLES, vertices=3)
        triangle.release()


def _vertices(picture: BrickView) -> npt.NDArray[Any]:
    """VERTEX [n]: what the device is told of each brick, but for its place in the atlas."""
    vertices = np.zeros(len(picture.order), VERTEX)
    vertices["rectangle_px"] = picture.rectangles_px
    vertices["box_low"], vertices["box_high"] = picture.bounds[:, 0], picture.bounds[:, 1]
    vertices["first_corner"] = picture.corners
    vertices["steps"] = np.column_stack([picture.cells_per_voxel, picture.steps])
    return vertices


def _tables(pieces: PiecewiseTransfer) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Guide and pieces as brick_pieces.glsl has them, float32 [rows, columns, channels]."""
    num_rows = -(-len(pieces.rows) // PIECES_IN_ROW)
    rows = np.zeros((num_rows, 3, PIECES_IN_ROW, 4), np.float32)
    row, column = np.divmod(np.arange(len(pieces.rows)), PIECES_IN_ROW)
    rows[row, 0, column], rows[row, 1, column] = pieces.rows[:, 2:6], pieces.rows[:, 6:]
    rows[row, 2, column, 0] = np.minimum(pieces.rows[:, 0] - FILTER_ERROR, np.float32(LARGEST))
    rows[row, 2, column, 1] = pieces.rows[:, 1]
    return pieces.guide.astype(np.float32)[None, :, None], rows.reshape(3 * num_rows, PIECES_IN_ROW, 4)
