"""Rasterise splats with OpenGL; bricks need no OpenGL.

The context is made by EGL without a display (any GPU's driver, or Mesa's llvmpipe), and the target is float32 RGBA.
Splats are sorted back to front and uploaded in batches of bounded size, so that neither their number nor the driver's
limits on buffers matter:

    batch of splats -> vertex buffer -> points, quads (larger than the driver's points) or triangle fans
                    -> fragment alpha -> blended "over", premultiplied, in float32 -> read back once a tile
                    -> the mean of a pixel's samples

Splats are drawn on a lattice of samples: a regular grid, with one or several samples in each pixel. Large lattices are
drawn tile by tile. Rows are drawn upside down, so that the image that is read back has row 0 at the top.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np

from renderer.draw.rasterizer import Rasterizer, RayColors
from renderer.draw.splats.compositing import MIN_CHUNK_SPLATS, splats_per_chunk
from renderer.draw.splats.programs import MAX_SHAPES, MESH_VERTEX, SPLAT_VERTEX, load_shader, vertex_content
from renderer.draw.splats.samples import (
    LARGEST_TILE,
    SMALLEST_TILE,
    Tile,
    average_samples,
    tiles_over,
    whole_pixels,
)
from renderer.errors import ContextLostError, RenderError
from renderer.kernels import ModelView
from renderer.splats import SplatBatch
from renderer.view import (
    CLIPPED_SIGMAS,
    Region,
    View,
    covered_region,
    longest_sigma,
    mean_footprint_area_px,
    model_view,
)
from renderer.volume import Array, Float32, Float64, Int64, UInt32

# A function that draws splats of a batch, given by their numbers, back to front.
DrawSplats = Callable[[UInt32], None]
# A function that draws splats of a batch, given by their numbers, into a tile, back to front.
DrawInTile = Callable[[Tile, UInt32], None]

# The most splats that are on the device at a time: 8 MiB of vertices.
BATCH_SIZE = 1 << 18
# The number of bytes of a splat's vertex.
VERTEX_BYTES = SPLAT_VERTEX.itemsize

# The most EGL devices that are tried; a machine has one for each GPU and one for the software renderer.
MAX_EGL_DEVICES = 9

# The packages of Debian and Ubuntu that provide EGL and Mesa's software renderer.
EGL_PACKAGES = "libegl1 libgl1 libgl1-mesa-dri"


class SplatRasterizer(Rasterizer):
    """A rasteriser of splats: an OpenGL context with its programs, for any number of frames of any size.

    Use it as a context manager, or call `release`. Making it raises RenderError if there is no context. Drawing raises
    RenderError if the device has no room for a tile of a picture, and ContextLostError if the context is lost; the
    rasteriser cannot be used any more then, and RecoveringRasterizer makes another one.
    """

    def __init__(self) -> None:
        self._context = _create_context()
        info = self._context.info
        # The names of the device and the driver. They are read now, because a lost context does not tell them.
        self.device = f"{info['GL_RENDERER']}, GL {info['GL_VERSION']}"
        self._largest_point_px = float(info["GL_POINT_SIZE_RANGE"][1])
        sides = info["GL_MAX_TEXTURE_SIZE"], info["GL_MAX_RENDERBUFFER_SIZE"], *info["GL_MAX_VIEWPORT_DIMS"]
        # The side of the tiles of pictures, in samples. GL would cut off a larger viewport without an error.
        self._tile_side = int(min(LARGEST_TILE, *sides))
        with self._drawing():
            self._splat_buffer = self._context.buffer(reserve=BATCH_SIZE * VERTEX_BYTES, dynamic=True)
            self._shape_buffer = self._context.buffer(reserve=MAX_SHAPES * 48, dynamic=True)
        self._programs: dict[str, Any] = {}  # the programs, by the name of their footprint
        self._target: Any = None
        # The functions that draw splats with a program, back to front, by the name of its footprint.
        self._draw_functions = {"gaussian": self._draw_gaussians, "gouraud": self._draw_fans}

    def release(self) -> None:
        """Free the context, and all programs and buffers in it."""
        self._context.release()

    def rasterize(
        self, batches: Sequence[SplatBatch], orders: Sequence[UInt32], view: View, colors: RayColors | None = None
    ) -> Float32:
        """Composite `batch[order]` of the only batch, back to front, over nothing.

        Returns float32 [height, width, 4], premultiplied RGBA.
        """
        with self._drawing():
            return self._rasterize_splats(batches[0], orders[0], view)

    @contextmanager
    def _drawing(self) -> Iterator[None]:
        """Make the context current, and raise ContextLostError if drawing in it fails.

        OpenGL itself raises no error if the device is reset or runs out of memory: it goes on, and images are wrong.
        """
        try:
            with self._context:  # makes it current: another context may have become current since the last picture
                try:
                    yield
                    self._context.gc()
                finally:
                    got = self._context.error  # read even after an exception, to clear it for the next picture
        except moderngl.Error as error:
            raise self._context_lost_error(str(error)) from error
        if got != "GL_NO_ERROR":
            raise self._context_lost_error(got)

    def _context_lost_error(self, got: str) -> ContextLostError:
        return ContextLostError("OpenGL failed to draw, or its context was lost", where=self.device, got=got)

    def _rasterize_splats(self, batch: SplatBatch, order: UInt32, view: View) -> Float32:
        across = batch.samples_across
        camera = model_view(batch, view.magnified(across))
        region, num_at_once = covered_region(batch, camera), len(order)
        if len(order) > MIN_CHUNK_SPLATS and region.num_pixels > 0:
            num_at_once = splats_per_chunk(region.num_pixels, mean_footprint_area_px(batch, order, camera, region))
        chunks = [order[first : first + num_at_once] for first in range(0, len(order), max(num_at_once, 1))]
        tile_size = self._target_for(camera.size, across).size
        draw = self._prepare_splats(batch, camera, tile_size)
        image = np.zeros((view.size[1], view.size[0], 4), np.float32)
        for tile in tiles_over(whole_pixels(region, across), tile_size):
            pixels = average_samples(self._rasterize_tile(partial(draw, tile), chunks, tile.part), across)
            top, left = (tile.top + tile.part.top) // across, (tile.left + tile.part.left) // across
            image[top : top + pixels.shape[0], left : left + pixels.shape[1]] = pixels
        return image

    def _prepare_splats(self, batch: SplatBatch, camera: ModelView, tile_size: tuple[int, int]) -> DrawInTile:
        """Upload the shapes and uniforms of a batch, and return the function that draws some of its splats."""
        footprint = batch.footprint
        self._shape_buffer.write(_shape_block(batch, camera))
        self._shape_buffer.bind_to_uniform_block(0)
        program = self._program(footprint.name)
        _set_camera(program, camera)
        program["tile_px"] = tile_size
        program["near_beyond_origin"] = camera.near + float(camera.view_from_model[2, 3])
        program["slope_limit"] = tuple(camera.slope_limit)
        for uniform in footprint.uniforms:
            program[uniform] = getattr(footprint, uniform)

        def draw(tile: Tile, order: UInt32) -> None:
            program["corner_px"] = tile.left, tile.top
            self._draw_functions[footprint.name](program, batch, camera, order)

        return draw

    def _rasterize_tile(self, draw: DrawSplats, chunks: Sequence[UInt32], part: Region) -> Float32:
        """Draw chunks of splats, back to front, into a part of a tile, without a background."""
        if len(chunks) == 1:
            return self._rasterize_chunk(draw, chunks[0], part)
        covered = np.zeros((part.height, part.width, 4))
        for order in chunks:
            chunk = self._rasterize_chunk(draw, order, part)
            covered *= 1.0 - chunk[..., 3:].astype(np.float64)
            covered += chunk
        return covered.astype(np.float32)

    def _rasterize_chunk(self, draw: DrawSplats, order: UInt32, part: Region) -> Float32:
        """Draw some splats into a part of a tile, without a background, blended in float32."""
        image = np.empty((part.height, part.width, 4), np.float32)
        self._context.enable_only(moderngl.BLEND | moderngl.PROGRAM_POINT_SIZE)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._target.use()
        self._target.clear(0.0, 0.0, 0.0, 0.0, viewport=tuple(part))
        for first in range(0, len(order), BATCH_SIZE):
            draw(order[first : first + BATCH_SIZE])
        self._target.read_into(image, viewport=tuple(part), components=4, dtype="f4")
        return image

    def _draw_gaussians(self, program: Any, batch: SplatBatch, camera: ModelView, order: UInt32) -> None:
        """Draw splats in their order, as points, or as quads where they are larger than the driver's points."""
        vertices = batch.vertices.take(order, axis=0)
        self._splat_buffer.orphan()
        self._splat_buffer.write(vertices)
        is_large = _size_bound_px(batch, vertices, camera) > self._largest_point_px
        run_ends = np.flatnonzero(np.diff(is_large)) + 1
        points = self._context.vertex_array(program, [vertex_content(self._splat_buffer, SPLAT_VERTEX)])
        large = np.repeat(vertices[is_large], 6, axis=0)
        quads = self._context.vertex_array(program, [vertex_content(self._buffer(large), SPLAT_VERTEX)])
        quads_before: Int64 = np.cumsum(is_large) - is_large
        for start, end in pairwise([0, *run_ends.tolist(), len(order)]):
            program["quads"] = bool(is_large[start])
            if is_large[start]:
                quads.render(moderngl.TRIANGLES, vertices=6 * (end - start), first=6 * int(quads_before[start]))
            else:
                points.render(moderngl.POINTS, vertices=end - start, first=start)

    def _draw_fans(self, program: Any, batch: SplatBatch, _: ModelView, order: UInt32) -> None:
        """Draw splats with a Gouraud footprint: each splat is an instance of the mesh."""
        footprint: Any = batch.footprint
        self._splat_buffer.orphan()
        self._splat_buffer.write(batch.vertices.take(order, axis=0))
        mesh = np.column_stack([footprint.vertices, footprint.weights]).astype(np.float32)
        content = [
            vertex_content(self._buffer(mesh), MESH_VERTEX),
            vertex_content(self._splat_buffer, SPLAT_VERTEX, "/i"),
        ]
        triangles = self._buffer(footprint.triangles)
        fans = self._context.vertex_array(program, content, index_buffer=triangles, index_element_size=4)
        fans.render(moderngl.TRIANGLES, instances=len(order))

    def _buffer(self, data: Array) -> Any:
        """Return an OpenGL buffer with data. OpenGL has no empty buffers, so a buffer without data has four bytes."""
        return self._context.buffer(data if data.size else bytes(4))

    def _program(self, footprint: str) -> Any:
        """Return the shader program of a footprint, which is compiled at its first use."""
        if footprint not in self._programs:
            self._programs[footprint] = self._context.program(
                vertex_shader=load_shader("project.glsl", "opacity.glsl", f"{footprint}_vertex.glsl"),
                fragment_shader=load_shader("opacity.glsl", f"{footprint}_fragment.glsl"),
            )
        return self._programs[footprint]

    def _target_for(self, size: tuple[int, int], across: int) -> Any:
        """Return a float32 RGBA framebuffer for a lattice of samples, or for its tiles, reused while its size stays.

        size: of the lattice. across: the samples along a pixel's side. Tiles become smaller if the device has no room
        for them. Raises RenderError if it has no room for the smallest; moderngl.Error if it refuses even a single
        pixel, as a lost context does.
        """
        while True:
            side = max(1, self._tile_side // across) * across
            tile_size = min(size[0], side), min(size[1], side)
            if self._target is not None and self._target.size == tile_size:
                return self._target
            self._target = None
            try:
                self._target = self._make_target(tile_size)
            except moderngl.Error as error:
                self._make_target((1, 1))
                if max(tile_size) <= SMALLEST_TILE:
                    raise RenderError(
                        "the device has no room for a tile of a picture",
                        where=self.device,
                        got=f"{tile_size[0]} x {tile_size[1]} pixels",
                        hint="end other programs that use the device",
                    ) from error
                self._tile_side = max(tile_size) // 2
                _ = self._context.error  # clears the error of the refused framebuffer, which is no error of the picture

    def _make_target(self, size: tuple[int, int]) -> Any:
        return self._context.framebuffer([self._context.renderbuffer(size, 4, dtype="f4")])


def _create_context() -> Any:
    """Make a headless context on the first EGL device that allows it: users may lack permission for a GPU."""
    if _first_process() != os.getpid():
        raise RenderError(
            "OpenGL cannot be used in this process: it was forked from one that had used it",
            hint='start processes with multiprocessing.get_context("spawn"), or fork before anything is drawn',
        )
    failures = []
    for device in range(MAX_EGL_DEVICES):
        settings: dict[str, Any] = {"backend": "egl", "device_index": device}
        try:
            context = moderngl.create_context(require=330, standalone=True, **settings)
        except Exception as error:  # moderngl raises nothing more specific
            failures.append(error)
            continue
        context.gc_mode = "context_gc"  # `gc` frees objects without references
        return context
    raise RenderError(
        "no OpenGL 3.3 context could be made",
        got=str(failures[0]),
        expected="an EGL library and a driver: a GPU's, or Mesa's software renderer",
        hint=f"on Debian or Ubuntu: apt-get install {EGL_PACKAGES}; the footprint integrated needs none",
    ) from failures[0]


@functools.cache
def _first_process() -> int:
    """Return the id of the process that first used OpenGL. Forks of it lack the driver's threads, and calls hang."""
    return os.getpid()


def _set_camera(program: Any, camera: ModelView) -> None:
    """Set the uniforms that describe the camera, which all programs of splats have."""
    to_depth = np.diag([1.0, 1.0, -1.0]) @ camera.view_from_model
    program["view_rotation"] = tuple(to_depth[:, :3].T.ravel())  # GL stores matrices column by column
    program["view_translation"] = tuple(to_depth[:, 3])
    program["perspective"] = camera.perspective
    program["scale_px"] = camera.scale_px
    program["axis_px"] = tuple(camera.center_px)


def _shape_block(batch: SplatBatch, camera: ModelView) -> bytes:
    """Return the uniform block of shapes: the right, up and depth rows of each shape's axes, padded to four floats."""
    rows = np.zeros((MAX_SHAPES, 3, 4), np.float32)
    rows[: len(batch.axes), :, :3] = np.diag([1.0, 1.0, -1.0]) @ camera.view_from_model[:, :3] @ batch.axes
    return rows.tobytes()


def _size_bound_px(batch: SplatBatch, vertices: Float32, camera: ModelView) -> Float64:
    """Return an upper bound of the side of each footprint's square, float64 [n], in samples.

    It is infinite if the near plane may cut the splat.
    """
    sigma = longest_sigma(batch)[vertices[:, 7].astype(np.int64)]
    if not camera.perspective:
        sigma_px = sigma * camera.scale_px
    else:
        depth = -(vertices[:, :3] @ camera.view_from_model[2, :3] + camera.view_from_model[2, 3])
        steepest = np.sqrt(1 + np.sum(camera.slope_limit**2))
        safe = depth - camera.near > CLIPPED_SIGMAS * sigma
        sigma_px = np.divide(sigma * (camera.scale_px * steepest), depth, out=np.full(len(sigma), np.inf), where=safe)
    return 2 * batch.footprint.cutoff * np.maximum(sigma_px, batch.footprint.min_sigma_px) + 1
