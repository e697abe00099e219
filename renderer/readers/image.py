"""Define the image that a reader returns: voxels, their place in the world, and their description in the file."""

from __future__ import annotations

from dataclasses import dataclass, field

from renderer.readers.steps_in_time import TimeSteps
from renderer.readers.store_blocks import Blocks
from renderer.readers.units import Units
from renderer.volume import Array, Channel, Float64, Label, VolumeLevel


@dataclass(frozen=True)
class Image:
    """An image as a reader returns it: voxels as stored, and their place in the world.

    values: [z, y, x] of one time step and one component, an integer or float dtype in any byte order and memory layout,
        possibly mapped from a file.
    world_from_index: float64 [4, 4], the affine from voxel indices (x, y, z) to the world.
    notes: remarks on how the voxels were read; None is ignored.
    nodata: ranges of values, both ends included, that mark absent voxels in the file.
    channels: the description of each component, if there are several.
    labels: the labels that the file describes, by value.
    steps: the steps in time of the file.
    units: the units of lengths and values, and the axes of the world.
    has_lengths: whether the format can hold the lengths of a voxel.
    levels: the levels of a store, from the finest to the coarsest.
    box: the half-open ranges of voxels along x, y and z that `values` hold, if the reader has read them alone; the
        affine is then still of all voxels. None if `values` hold all voxels.
    finest_from_index: float64 [4, 4], from the voxel indices of this level to those of the finest level. A spacing in
        the scene is of the finest level.
    marks: a text that changes when the metadata of the store do, if it is at a URL.
    is_on_disk: whether `values` are mapped from a temporary file or from an entry of the cache folder, so that they
        take memory only for as long as nothing else needs it.
    blocks: the blocks of a level of a store that were read, if `values` are an array of blocks: [blocks, voxels of a
        block], both along z, y, x, as of `Blocks.shape_in`. Other blocks are 0. None if `values` are as above.
    """

    values: Array
    world_from_index: Float64
    notes: tuple[str | None, ...] = ()
    nodata: tuple[tuple[float, float], ...] = ()
    channels: tuple[Channel, ...] = ()
    labels: tuple[Label, ...] = ()
    steps: TimeSteps = field(default=TimeSteps())
    units: Units = field(default=Units())
    has_lengths: bool = True
    levels: tuple[VolumeLevel, ...] = ()
    box: tuple[tuple[int, int], ...] | None = None
    finest_from_index: Float64 | None = None
    marks: str = ""
    is_on_disk: bool = False
    blocks: Blocks | None = None
