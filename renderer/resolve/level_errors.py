"""Measure the error of coarse levels of a store by exact rays through a few pixels.

Two rays pass through random places of a pixel, the same through each level. With d1 and d2 the differences of their
colours between two levels, d1 times d2 has the expectation of the squared difference of the pixel's means. The pixels
lie in a few cells of a grid over the frame; a cell counts as one sample. The larger the differences of two coarse
levels are in and around a cell, the larger is its chance. Of the finest level, only the chunks near the rays are read.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from renderer.accuracy import ErrorSamples, error_samples, is_loop, pool_samples, spread_evenly
from renderer.errors import InputError
from renderer.film import behind_rows, over_rows
from renderer.frame import FilmStage, Stage, view_of
from renderer.kernels import PlacedVoxels, ThreadPool
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
# The number of cells of a grid over each frame that are chosen. The finest level is read where rays through them go,
# which takes most of the time: 5 cells of a volume of 4 GiB cross 100 MiB.
_NUM_CELLS = 5
# The number of cells where the error of a level is too near to the allowed one.
_MANY_CELLS = 15
# The number of pixels of a chosen cell that get two exact rays. Rays through the same cell need the same chunks. With
# 16 pixels in place of 8, the deviation of the estimate is 5 to 12 % smaller.
_PIXELS_PER_CELL = 16
# The number of cells along the longer side of a frame.
_SIDE = 64
# The weight of a cell is the mean of squared differences of two coarse levels, by one ray through each cell of a square
# of this many cells along a side around it. One ray alone misses fine detail: an error may be large where it finds no
# difference. Of estimates by 24 cells of four pictures, the deviation was 0.20 to 0.41 of the error with 3, 0.20 to
# 0.46 with 5, and 0.44 to 1.9 with 1. With four rays through the cell itself, it was 0.22 to 1.5.
_WINDOW = 3
# This share of the mean weight of cells is added to each weight.
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


class _Weighted(NamedTuple):
    """A frame whose pixels are to be chosen. weights: float64 [y, x], of the cells of a grid over it."""

    stage: Stage
    frame: int
    weights: Float64


class LevelErrors:
    """A measurement of the levels of a store. num_bytes: the bytes of the finest level that it has read.

    film: a stage with a coarse level. is_measured: whether a volume is of the store. other: returns the volume of
        another coarse level, whose differences from the first one say where errors are.
    """

    def __init__(self, film: FilmStage, is_measured: IsMeasured, other: VolumeOf) -> None:
        self._is_measured, self.num_bytes = is_measured, 0
        self._read: dict[VolumeSpec, Bools] = {}  # the blocks of the finest level that were read
        layers = film.scene.film_layers
        is_still = not any(layer.map(lambda each: each.volume).moves for layer in layers)
        path = film.scene.at(0).camera.path
        frames = spread_evenly(range(film.scene.num_frames), _NUM_FRAMES, is_loop=is_loop(path)) if is_still else [0]
        stages = [(film.at(frame) if frame else film.first, frame) for frame in frames]
        self._weighted = [_Weighted(*each, self._weights(*each, other)) for each in stages]
        self._measure(_NUM_CELLS)

    def use_more_rays(self) -> bool:
        """Measure by more rays from now on, which takes longer. Return False if that was done before."""
        if self._samples[0].factors.size == _MANY_CELLS:
            return False
        self._measure(_MANY_CELLS)
        return True

    def _measure(self, num_cells: int) -> None:
        """Choose rays through a number of cells of each frame, and find their colours with the finest level."""
        self._samples = [_sample(each, num_cells) for each in self._weighted]
        self._finest = self._colors(self._read_finest())

    def error_of(self, volume_of: VolumeOf) -> ErrorSamples:
        """Return the squared error of pictures of a level. volume_of: returns the volume of this level."""
        found = []
        for sample, finest, coarse in zip(self._samples, self._finest, self._colors(volume_of), strict=True):
            differences = (coarse - finest).reshape(-1, 2, 3)
            products = (differences[:, 0] * differences[:, 1]).reshape(len(sample.factors), -1)
            found.append(error_samples(sample.factors * products.mean(axis=1)))
        return pool_samples(found)

    def _weights(self, stage: Stage, frame: int, other: VolumeOf) -> Float64:
        """Return the weights of the cells of a frame, by the differences of two coarse levels: float64 [y, x]."""
        view = view_of(stage, frame)
        factor = min(1.0, _SIDE / max(view.size))
        width, height = (max(1, round(side * factor)) for side in view.size)
        weights = mean_around(self._differences(stage, frame, other, (width, height)))
        weights += _EVEN * weights.mean() or 1.0
        return weights

    def _read_finest(self) -> VolumeOf:
        """Read the parts of the finest level that the rays need. Return the function that returns its volume."""
        found, num_bytes = dict[VolumeSpec, Volume](), 0
        for layer in self._samples[0].stage.layers:
            spec = replace(layer.spec.volume, level=0)
            if not self._is_measured(layer.spec.volume) or spec in found:
                continue
            image = _part(spec, None, layer)
            blocks = Blocks.of_level(image.levels[0])
            wanted = [self._wanted(sample, image, layer.spec.volume, blocks) for sample in self._samples]
            blocks = replace(blocks, wanted=np.any([*wanted, self._read.get(spec, blocks.wanted)], axis=0))
            self._read[spec] = blocks.wanted
            image = _part(spec, blocks, layer)
            num_voxels = sum(int(np.prod(np.diff(box, axis=1))) for box in blocks.boxes(image.box or ()))
            num_bytes += num_voxels * image.values.dtype.itemsize
            found[spec] = _volume(layer, image)
        self.num_bytes = num_bytes
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
        """Return the squared difference of two coarse levels by a ray through each cell of a frame: float64 [y, x].

        size: the number of cells along the width and the height.
        """
        view = view_of(stage, frame)
        small = replace(view, size=size, scale_px=view.scale_px * size[1] / view.size[1])
        cells = np.arange(size[0] * size[1])
        places = places_in_pixels(cells, size[0], np.ones(cells.size, np.int64), 1, (_SEED, frame)).reshape(-1, 2)
        behind = np.zeros((len(places), 3))
        sample = _Sample(stage, small, places, np.empty(0), behind)
        shown = [self._shown(sample, volume_of) for volume_of in (None, other)]
        one, two = (_colors_of(each, num_threads=num_cores()) for each in shown)
        return np.asarray(((one - two) ** 2).mean(axis=1).reshape(size[::-1]))

    def _colors(self, volume_of: VolumeOf) -> list[Float64]:
        """Return the colours of all rays, float64 [n, 3] for each frame, with a level of the measured volumes.

        The rays of a frame are few: the frames are shared among threads.
        """
        shown = [self._shown(sample, volume_of) for sample in self._samples]
        with ThreadPool(min(num_cores(), len(shown))) as pool:
            return pool.map(lambda each: _colors_of(each, num_threads=1), shown)

    def _shown(self, sample: _Sample, volume_of: VolumeOf | None) -> _Sample:
        """Return the rays of a frame through a level. volume_of: None for the stage's own level."""

        def volume(layer: Layer) -> Volume | None:
            spec = layer.spec.volume
            return volume_of(spec) if volume_of is not None and self._is_measured(spec) else None

        layers = [with_level(layer, volume(layer), sample.stage.scene) for layer in sample.stage.layers]
        return replace(sample, stage=replace(sample.stage, layers=tuple(layers)))


def _colors_of(sample: _Sample, *, num_threads: int) -> Float64:
    """Return the colours of the rays of a frame, float64 [n, 3]."""
    is_lit = any(layer.spec.shading is not None for layer in sample.stage.layers)
    rays = SceneRays(sample.stage, num_threads=num_threads)
    radiance = rays.integrate(sample.view, sample.places, _SHADED_STEP if is_lit else _STEP)
    return over_rows(radiance[:, None], sample.behind)[:, 0]


def _sample(weighted: _Weighted, num_cells: int) -> _Sample:
    """Choose cells of a frame by their weights, and rays through some pixels of each."""
    stage, frame, weights = weighted
    view, background = view_of(stage, frame), stage.scene.background
    height, width = weights.shape
    ends = np.cumsum(weights) / weights.sum()
    random = np.random.default_rng((_SEED, frame)).random(num_cells)
    chosen = np.searchsorted(ends, (np.arange(num_cells) + random) / num_cells, side="right")
    chosen = np.minimum(chosen, weights.size - 1)
    factors = weights.mean() / weights.reshape(-1)[chosen]
    cells = np.repeat(chosen, _PIXELS_PER_CELL)
    each = np.ones(cells.size, np.int64)
    # A random point in the cell; the pixel of the frame around it is taken.
    points = places_in_pixels(cells, width, each, 1, (_SEED, frame, 0)).reshape(-1, 2)
    column, row = (points * np.divide(view.size, (width, height))).astype(np.int64).T
    pixels = np.minimum(row, view.size[1] - 1) * view.size[0] + np.minimum(column, view.size[0] - 1)
    places = places_in_pixels(pixels, view.size[0], each, 2, (_SEED, frame, 1))
    behind = behind_rows(background, view.size[1])[pixels // view.size[0]]
    return _Sample(stage, view, places.reshape(-1, 2), factors, np.repeat(behind, 2, axis=0))


def mean_around(numbers: Float64) -> Float64:
    """Return the means of numbers of cells over a square of cells around each, float64 [y, x].

    Beyond the border, the nearest cell is repeated.
    """
    padded = np.pad(numbers, _WINDOW // 2, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, (_WINDOW, _WINDOW))
    return np.asarray(windows.mean(axis=(2, 3)))


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
