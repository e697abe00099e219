"""Define a scalar volume in its own dtype, and its place in the world."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from renderer.kernels import MaskGrid, PlacedVoxels
from renderer.volume.arrays import Array, Bools, Float64, UInt8
from renderer.volume.channel import Channel
from renderer.volume.fingerprint import Fingerprint, joined_range, slab_range
from renderer.volume.kept_passes import kept_pass
from renderer.volume.label import Label
from renderer.volume.mapped_file import MappedFile
from renderer.volume.mask import make_mask_grid, shown_voxels
from renderer.volume.slabs import map_slabs
from renderer.volume.volume_level import VolumeLevel


@dataclass(frozen=True)
class Volume:
    """A scalar volume: voxels and their place in the world.

    values: [z, y, x], any integer or float dtype in native byte order, read-only, C-contiguous; finite, or NaN for
        absent voxels.
    world_from_index: float64 [4, 4], the affine from voxel indices (x, y, z) to the world. Voxel centres sit at integer
        indices, and the volume covers [-1/2, n - 1/2] per axis.
    name: the name of the volume in messages.
    digest: the fingerprint, which is computed when it is first asked for.
    source: the file from which the values are mapped; None for values in memory. Call `require_unchanged` before
        reading values, and again before using them.
    num_absent: the number of absent voxels.
    file_spacing: the spacing in the file, if the scene gives another; else None.
    note: a remark for the user on how the volume was read.
    has_lengths: whether the volume's file, or the scene, gives the lengths of a voxel.
    channels: the descriptions of all components of the volume's file; empty for a file with one component.
    is_labels: whether the values are numbers of labels, 0 for none, between which nothing is interpolated.
    mask: a volume of the labels 0 and 1 on a grid of its own; this volume is shown only where the mask is 1. None to
        show all.
    labels: the labels that the file describes, by value.
    num_times: the number of steps in time of the series. The volume is one of the steps, or lies between two of them.
    times: the time of each step, ascending, if the file gives it. time_unit: `s`, or empty if it is unknown.
    length_unit, value_unit: the units of world lengths and of values, such as `mm` and `HU`; empty if unknown.
    world_axes: `LPS` if the axes of the world point to the left of a body, to its back and up; else empty.
    colors: uint8 [z, y, x, 3], read-only, the colours of voxels that are colours; the values are then their luminance
        or their alpha.
    levels: the levels of the volume's store, from the finest to the coarsest; empty for any other file.
    finest_share: the finest spacing of the store's finest level, as a share of this level's finest spacing.
    is_on_disk: whether the values were decoded into a file: a temporary one, or one of the cache folder.
    voxels: the voxels for exact rays, if only some blocks of a level were read: `values` are then zeros, which take no
        memory and are not used. None if `values` are the voxels.
    """

    values: Array
    world_from_index: Float64
    name: str
    digest: Fingerprint
    source: MappedFile | None = None
    num_absent: int = 0
    file_spacing: tuple[float, float, float] | None = None
    note: str | None = None
    has_lengths: bool = True
    channels: tuple[Channel, ...] = ()
    is_labels: bool = False
    mask: Volume | None = None
    labels: tuple[Label, ...] = ()
    colors: UInt8 | None = None
    num_times: int = 1
    times: tuple[float, ...] = ()
    time_unit: str = ""
    length_unit: str = ""
    world_axes: str = ""
    value_unit: str = ""
    levels: tuple[VolumeLevel, ...] = ()
    finest_share: float = 1.0
    is_on_disk: bool = False
    voxels: PlacedVoxels | None = None

    @property
    def fingerprint(self) -> str:
        """Return the hexadecimal digest of voxels, dtype, shape and affine, equal for equal volumes of different files.

        The first call passes over all values. Raises InputError if the volume's file has changed.
        """
        return self.digest.text()

    def require_unchanged(self) -> None:
        """Raise InputError if the values are mapped from a file that has changed."""
        if self.source is not None:
            self.source.require_unchanged()

    def value_range(self) -> tuple[float, float]:
        """Return the smallest and the largest value without absent voxels. The first call passes over all values.

        Values that were read for the fingerprint are not read again.
        """
        return self._value_range

    @cached_property
    def _value_range(self) -> tuple[float, float]:
        if self.voxels is not None:
            return slab_range(self.voxels.values)
        known = self.digest.range_of(self.values)
        if known is not None:
            return known
        low, high = kept_pass("range", self.values, self.source, self._measured_range)["range"].tolist()
        return low, high

    def _measured_range(self) -> dict[str, Array]:
        ends = map_slabs(lambda _, slab: slab_range(slab), self.values, self.source)
        return {"range": np.array(joined_range(ends))}

    @cached_property
    def are_absent(self) -> Bools:
        """Return which voxels are absent: bool [z, y, x]."""
        return np.isnan(self.values)

    @cached_property
    def mask_grid(self) -> MaskGrid | None:
        """Return the mask as kernels take it, for this volume's index space; None without a mask."""
        if self.mask is None:
            return None
        mask_from_world = np.asarray(np.linalg.inv(self.mask.world_from_index), np.float64)
        return make_mask_grid(self.mask.values, mask_from_world, self.world_from_index)

    @cached_property
    def are_shown(self) -> UInt8 | None:
        """Return which voxels have their centres in the mask: uint8 [z, y, x]; None without a mask."""
        return None if self.mask_grid is None else shown_voxels(self.mask_grid, self.values.shape)

    @property
    def shape_xyz(self) -> tuple[int, int, int]:
        """Return the number of voxels along x, y, z."""
        z, y, x = self.values.shape
        return x, y, z

    @property
    def spacing(self) -> Float64:
        """Return the world distances between neighbouring voxel centres along the index axes x, y, z: float64 [3]."""
        return np.asarray(np.linalg.norm(self.world_from_index[:3, :3], axis=0), np.float64)

    @property
    def finest_spacing(self) -> float:
        """Return the smallest spacing, which is the unit length of optical depths."""
        return float(self.spacing.min())

    @property
    def opacity_unit(self) -> float:
        """Return the world length that opacities refer to if a scene names none; it is the same for all levels."""
        return self.finest_share * self.finest_spacing

    @property
    def voxel_volume(self) -> float:
        """Return the world volume of one voxel."""
        return abs(float(np.linalg.det(self.world_from_index[:3, :3])))

    @property
    def half_diagonal(self) -> float:
        """Return half the world length of the volume's diagonal, as if its axes were at right angles."""
        return 0.5 * float(np.linalg.norm(self.world_from_index[:3, :3] * np.array(self.shape_xyz)))

    @property
    def centre_index(self) -> Float64:
        """Return the centre of the volume in voxel indices x, y, z: float64 [3]."""
        return (np.array(self.shape_xyz) - 1) / 2

    @property
    def centre(self) -> Float64:
        """Return the centre of the volume in the world, to which all drawing is relative: float64 [3]."""
        return self.world_from_index[:3, :3] @ self.centre_index + self.world_from_index[:3, 3]

    @property
    def world_box(self) -> tuple[Float64, Float64]:
        """Return the lowest and the highest corner of the box around the volume, along the axes of the world."""
        reach = np.abs(self.world_from_index[:3, :3]) @ self.shape_xyz / 2
        return self.centre - reach, self.centre + reach


def make_volume(
    values: Array,
    world_from_index: Float64,
    name: str,
    source: MappedFile | None = None,
    *,
    num_absent: int = 0,
    colors: UInt8 | None = None,
) -> Volume:
    """Make a Volume from `values` and `colors`, which become read-only and are not copied.

    values: [z, y, x], native byte order, C-contiguous, an integer or float dtype; finite, except for `num_absent` NaN.
    world_from_index: float64 [4, 4]. colors: the colours of voxels, None for a volume of scalars.
    source: the file from which the values are mapped, if any.
    """
    assert values.ndim == 3, values.shape
    assert values.flags.c_contiguous, values.strides
    assert values.dtype.isnative, values.dtype
    values.flags.writeable = False
    # Adding 0.0 turns -0.0 into 0.0, so that equal affines have equal bytes.
    placed = np.array(world_from_index, np.float64) + 0.0
    placed.flags.writeable = False
    if colors is not None:
        colors.flags.writeable = False
    digest = Fingerprint(values, placed, source, colors)
    return Volume(values, placed, name, digest, source, num_absent, colors=colors)


def sampled_volume(volume: Volume, most: int) -> Volume:
    """Return a volume of every n-th voxel, with at most `most` voxels along each axis, and with the same mask.

    Raises InputError if the volume's file has changed.
    """
    z, y, x = (-(-side // most) for side in volume.values.shape)
    values = np.ascontiguousarray(volume.values[::z, ::y, ::x])
    colors = None if volume.colors is None else np.ascontiguousarray(volume.colors[::z, ::y, ::x])
    num_absent = int(np.count_nonzero(np.isnan(values)))
    volume.require_unchanged()
    placed = volume.world_from_index @ np.diag([x, y, z, 1.0])
    made = make_volume(values, placed, volume.name, num_absent=num_absent, colors=colors)
    return replace(made, mask=volume.mask)


def move_volume(volume: Volume, matrix: Float64) -> Volume:
    """Return a volume that is moved in the world by a matrix, float64 [4, 4].

    It keeps `world_axes` only if no axis turns by more than 30 degrees, as in most registrations.
    """
    placed = np.asarray(matrix @ volume.world_from_index, np.float64) + 0.0
    placed.flags.writeable = False
    text = hashlib.blake2b(volume.fingerprint.encode("ascii") + placed.tobytes(), digest_size=16).hexdigest()
    turns = np.diag(matrix[:3, :3]) < math.cos(math.radians(30)) * np.linalg.norm(matrix[:3, :3], axis=0)
    axes = "" if turns.any() else volume.world_axes
    digest = Fingerprint(volume.values, placed, text=text)
    moved = replace(volume, world_from_index=placed, digest=digest, world_axes=axes)
    return replace(moved, has_lengths=True)  # a matrix is given in world lengths, which are then known


def joint_fingerprint(volumes: Sequence[Volume]) -> str:
    """Return one fingerprint for several volumes in their order. A single volume keeps its own fingerprint."""
    if len(volumes) == 1:
        return volumes[0].fingerprint
    joined = " ".join(volume.fingerprint for volume in volumes)
    return hashlib.blake2b(joined.encode("ascii"), digest_size=16).hexdigest()
