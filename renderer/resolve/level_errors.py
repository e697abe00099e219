"""Measure the error of coarse levels of a store by exact rays through a few pixels.

Two rays pass through random places of a pixel, the same through each level. With d1 and d2 the differences of their
colours between two levels, d1 times d2 has the expectation of the squared difference of the pixel's means. The pixels
lie in a few cells of a grid over the frame; a cell counts as one sample. The larger the difference of two coarse levels
is in a cell, the larger is its chance. Of the finest level, only the chunks near the rays are read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from renderer.accuracy import ErrorSamples, error_samples, is_loop, pool_samples, spread_evenly
from renderer.errors import InputError
from renderer.film import behind_rows, over_rows
from renderer.frame import FilmStage, Stage, view_of
from renderer.kernels import PlacedVoxels
from renderer.layers import Layer, with_level
from renderer.readers import Blocks, Image, read_part
from renderer.resolve.crossed_blocks import crossed_blocks
from renderer.scene import VolumeSpec
from renderer.system import num_cores
from renderer.truth import SceneRays, index_rays, places_in_pixels
from renderer.view import View
from renderer.volume import Bools, Fingerprint, Float64, Volume, move_volume

# At most this many frames are measured.
_NUM_FRAMES = 3
# The number of cells of a grid over each frame that are chosen.
_NUM_CELLS = 8
# The number of pixels of a chosen cell that get two exact rays. Rays through the same cell need the same chunks.
_PIXELS_PER_CELL = 8
# The number of cells along the longer side of a frame.
_SIDE = 64
# The number of squares along the side of a cell that get a ray each, by which two coarse levels are compared.
_SQUARES = 2
# This share of the mean weight of cells, the squared differences of two coarse levels, is added to each weight.
_EVEN = 0.2
# The number by which the choice of pixels begins.
_SEED = 0
# The fingerprint of a part of the finest level, which is not known.
_FINGERPRINT = "part"
# The length of a step of exact rays, in voxels, without and with shading, as of probes.
_STEP = 1.0
_SHADED_STEP = 0.5

# A function that returns whether a volume is of the store that is measured.
IsMeasured = Callable[[VolumeSpec], bool]
# A function that returns the volume of a layer at another level.
VolumeOf = Callable[[VolumeSpec], Volume]


@dataclass(frozen=True)
class _Sample:
    """Rays through some pixels of a frame, in cells of a grid over the frame.

    places: float64 [rays, 2], cell by cell and pixel by pixel. factors: float64 [cells], 1 / (chance of the cell
    * number of all cells). behind: float64 [rays, 3], the background behind each ray.
    """

    stage: Stage
    view: View
    places: Float64
    factors: Float64
    behind: Float64


class LevelErrors:
    """A measurement of the levels of a store. num_bytes: the bytes of the finest level that it has read.

    film: a stage with a coarse level. is_measured: whether a volume is of the store. other: returns the volume of
        another coarse level, whose differences from the first one say where errors are.
    """

    def __init__(self, film: FilmStage, is_measured: IsMeasured, other: VolumeOf) -> None:
        self._is_measured, self.num_bytes = is_measured, 0
        layers = film.scene.film_layers
        is_still = not any(layer.map(lambda each: each.volume).moves for layer in layers)
        path = film.scene.at(0).camera.path
        frames = spread_evenly(range(film.scene.num_frames), _NUM_FRAMES, is_loop=is_loop(path)) if is_still else [0]
        self._samples = [self._sample(film.at(frame) if frame else film.first, frame, other) for frame in frames]
        self._finest = self._colors(self._read_finest())

    def error_of(self, volume_of: VolumeOf) -> ErrorSamples:
        """Return the squared error of pictures of a level. volume_of: returns the volume of this level."""
        found = []
        for sample, finest, coarse in zip(self._samples, self._finest, self._colors(volume_of), strict=True):
            differences = (coarse - finest).reshape(-1, 2, 3)
            products = (differences[:, 0] * differences[:, 1]).reshape(len(sample.factors), -1)
            found.append(error_samples(sample.factors * products.mean(axis=1)))
        return pool_samples(found)

    def _sample(self, stage: Stage, frame: int, other: VolumeOf) -> _Sample:
        """Choose pixels of a frame by the differences of two coarse levels."""
        view, background = view_of(stage, frame), stage.scene.background
        factor = min(1.0, _SIDE / max(view.size))
        width, height = (max(1, round(side * factor)) for side in view.size)
        weights = self._differences(stage, frame, other, (width, height))
        weights += _EVEN * weights.mean() or 1.0
        ends = np.cumsum(weights) / weights.sum()
        random = np.random.default_rng((_SEED, frame)).random(_NUM_CELLS)
        chosen = np.searchsorted(ends, (np.arange(_NUM_CELLS) + random) / _NUM_CELLS, side="right")
        chosen = np.minimum(chosen, weights.size - 1)
        factors = weights.mean() / weights[chosen]
        cells = np.repeat(chosen, _PIXELS_PER_CELL)
        each = np.ones(cells.size, np.int64)
        # A random point in the cell; the pixel of the frame around it is taken.
        points = places_in_pixels(cells, width, each, 1, (_SEED, frame, 0)).reshape(-1, 2)
        column, row = (points * np.divide(view.size, (width, height))).astype(np.int64).T
        pixels = np.minimum(row, view.size[1] - 1) * view.size[0] + np.minimum(column, view.size[0] - 1)
        places = places_in_pixels(pixels, view.size[0], each, 2, (_SEED, frame, 1))
        behind = behind_rows(background, view.size[1])[pixels // view.size[0]]
        return _Sample(stage, view, places.reshape(-1, 2), factors, np.repeat(behind, 2, axis=0))

    def _read_finest(self) -> VolumeOf:
        """Read the parts of the finest level that the rays need. Return the function that returns its volume."""
        found: dict[VolumeSpec, Volume] = {}
        for layer in self._samples[0].stage.layers:
            spec = replace(layer.spec.volume, level=0)
            if not self._is_measured(layer.spec.volume) or spec in found:
                continue
            image = _part(spec, None, layer)
            blocks = Blocks.of_level(image.levels[0])
            wanted = [self._wanted(sample, image, layer.spec.volume, blocks) for sample in self._samples]
            blocks = replace(blocks, wanted=np.any(wanted, axis=0))
            image = _part(spec, blocks, layer)
            num_voxels = sum(int(np.prod(np.diff(box, axis=1))) for box in blocks.boxes(image.box or ()))
            self.num_bytes += num_voxels * image.values.dtype.itemsize
            found[spec] = _volume(layer, image)
        return lambda spec: found[replace(spec, level=0)]

    def _wanted(self, sample: _Sample, image: Image, spec: VolumeSpec, blocks: Blocks) -> Bools:
        """Return the blocks that the rays of a frame need: bool [z, y, x]. spec: the volume that is read."""
        found = np.zeros_like(blocks.wanted)
        for layer in sample.stage.layers:
            if layer.spec.volume == spec:
                volume, matrix = _volume(layer, image), layer.spec.transform
                placed = volume if matrix is None else move_volume(volume, np.array(matrix))
                rays = index_rays(placed, sample.view.clipped(layer.spec.clip), sample.places)
                found |= crossed_blocks(blocks, image.box or (), rays)
        return found

    def _differences(self, stage: Stage, frame: int, other: VolumeOf, size: tuple[int, int]) -> Float64:
        """Return the mean squared difference of two coarse levels in each cell of a frame: float64 [cells].

        size: the number of cells along the width and the height.
        """
        view = view_of(stage, frame)
        small = replace(view, size=size, scale_px=view.scale_px * size[1] / view.size[1])
        cells = np.arange(size[0] * size[1])
        places = places_in_pixels(cells, size[0], np.full(cells.size, _SQUARES), 1, (_SEED, frame)).reshape(-1, 2)
        behind = np.zeros((len(places), 3))
        sample = _Sample(stage, small, places, np.empty(0), behind)
        one, two = (self._colors_of(sample, volume_of) for volume_of in (None, other))
        return np.asarray(((one - two) ** 2).reshape(cells.size, -1).mean(axis=1))

    def _colors(self, volume_of: VolumeOf) -> list[Float64]:
        """Return the colours of all rays, float64 [n, 3] for each frame, with a level of the measured volumes."""
        return [self._colors_of(sample, volume_of) for sample in self._samples]

    def _colors_of(self, sample: _Sample, volume_of: VolumeOf | None) -> Float64:
        """Return the colours of the rays of a frame, float64 [n, 3]. volume_of: None for the stage's own level."""

        def volume(layer: Layer) -> Volume | None:
            spec = layer.spec.volume
            return volume_of(spec) if volume_of is not None and self._is_measured(spec) else None

        layers = [with_level(layer, volume(layer), sample.stage.scene) for layer in sample.stage.layers]
        stage = replace(sample.stage, layers=tuple(layers))
        is_lit = any(layer.spec.shading is not None for layer in layers)
        rays = SceneRays(stage, num_threads=num_cores())
        radiance = rays.integrate(sample.view, sample.places, _SHADED_STEP if is_lit else _STEP)
        return over_rows(radiance[:, None], sample.behind)[:, 0]


def _part(spec: VolumeSpec, blocks: Blocks | None, layer: Layer) -> Image:
    """Return a part of a level of a layer's store, as `read_part`. Raises InputError if it is no store any more."""
    image = read_part(spec, blocks)
    if image is None or image.box is None:
        raise InputError("this store was changed while its levels were measured", where=layer.volume.name)
    return image


def _volume(layer: Layer, image: Image) -> Volume:
    """Return a part of the finest level as the volume of a layer, unplaced, with the layer's mask."""
    placed = np.array(image.world_from_index) + 0.0
    values, voxels = image.values, None
    if image.blocks is not None and image.box is not None:
        voxels = PlacedVoxels(values.reshape(-1), *image.blocks.places(image.box))
        shape = [end - begin for begin, end in image.box[::-1]]
        values = np.broadcast_to(np.zeros(1, values.dtype), shape)
    # Nobody asks for the fingerprint of a level that is measured, but a volume that is moved has one.
    digest = Fingerprint(values, placed, text=_FINGERPRINT)
    own = replace(layer.volume, values=values, world_from_index=placed, digest=digest, source=None)
    return replace(own, is_labels=False, finest_share=1.0, voxels=voxels)
