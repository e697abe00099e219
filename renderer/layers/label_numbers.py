"""Number the labels that a layer shows, and restrict a volume to a mask."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.errors import InputError
from renderer.scene import format_value
from renderer.volume import Array, Fingerprint, Volume, iter_slabs, joint_fingerprint


def number_labels(volume: Volume, shown: Sequence[int], *, as_one: bool = False) -> Volume:
    """Return a volume with a number in place of each label: 1, 2, ... for the labels shown, 0 for all others.

    The volume keeps its fingerprint.

    shown: the labels that are shown, ascending. as_one: whether all shown labels have the number 1.
    Raises InputError for a label that no voxel has, and if the volume's file was changed.
    """
    values = volume.values if volume.voxels is None else volume.voxels.values.reshape(-1, 1, 1)
    labels, numbers = np.array(shown), np.arange(1, len(shown) + 1, dtype=np.min_scalar_type(len(shown)))
    found, counts = np.empty(values.shape, numbers.dtype), np.zeros(len(shown) + 1, np.int64)
    start = 0
    for slab in iter_slabs(values, volume.source):
        of_slab = _numbers_of(slab, labels, numbers)
        found[start : start + len(slab)] = of_slab
        counts += np.bincount(of_slab.ravel(), minlength=len(counts))
        start += len(slab)
    # A step in time may lack labels of other steps, and a part of a volume those of other parts.
    if volume.num_times == 1 and volume.voxels is None and not counts[1:].all():
        missing = format_value(labels[counts[1:] == 0].tolist())
        hint = "`hsplat info` lists its labels"
        raise InputError("no such labels in this volume", where=volume.name, got=missing, hint=hint)
    if as_one:
        found = np.minimum(found, 1).astype(np.uint8)
    found.flags.writeable = False
    if volume.voxels is not None:
        voxels = volume.voxels._replace(values=found.reshape(-1))
        return replace(volume, voxels=voxels, source=None, num_absent=0, is_labels=True)
    return replace(volume, values=found, source=None, is_on_disk=False, num_absent=0, is_labels=True)


def mask_volume(volume: Volume, mask: Volume, shown: Sequence[int]) -> Volume:
    """Return a volume that is shown only where a mask, a volume of labels, has one of the labels `shown`.

    A mask whose file gives no voxel size, and that has the volume's shape, is taken to lie on the volume's grid. Raises
    InputError for a label that no voxel of the mask has, and if a file was changed.
    """
    if not mask.has_lengths:
        note = mask.note or "this mask does not give its voxel size; 1 x 1 x 1 is assumed"
        mask = replace(mask, note=note)
        if mask.shape_xyz == volume.shape_xyz:
            note = f"{note}; it has the shape of {volume.name}, and so its grid is taken"
            mask = replace(mask, world_from_index=volume.world_from_index, note=note)
    digest = Fingerprint(volume.values, volume.world_from_index, text=joint_fingerprint([volume, mask]))
    return replace(volume, mask=number_labels(mask, shown, as_one=True), digest=digest)


def leave_out_masked(volume: Volume) -> Volume:
    """Return a volume without a mask, in which the voxels whose centres its mask hides have no data.

    Raises InputError if the mask hides all voxels.
    """
    values = volume.values.astype(np.promote_types(volume.values.dtype, np.float32))
    values[volume.are_shown == 0] = np.nan
    values.flags.writeable = False
    num_absent = int(np.count_nonzero(np.isnan(values)))
    if num_absent == values.size:
        raise InputError("the mask shows no voxel of this volume", where=volume.name)
    return replace(volume, values=values, source=None, is_on_disk=False, mask=None, num_absent=num_absent)


def _numbers_of(values: Array, shown: Array, numbers: Array) -> Array:
    """Return the number of each label in `values`; 0 for NaN and for labels that are not shown.

    shown: the labels that are shown, ascending. numbers: the number of each shown label.
    """
    if values.dtype.kind in "iu" and values.dtype.itemsize <= 2:
        lowest = np.iinfo(values.dtype).min
        table = np.zeros(1 << 8 * values.dtype.itemsize, numbers.dtype)
        is_possible = (shown >= lowest) & (shown <= np.iinfo(values.dtype).max)
        table[shown[is_possible] - lowest] = numbers[is_possible]
        return table[values.astype(np.int64) - lowest]
    if values.dtype == np.uint64:  # numpy would compare uint64 with int64 as float64
        values = values.astype(np.int64)
    at = np.minimum(np.searchsorted(shown, values), len(shown) - 1)
    return np.where(shown[at] == values, numbers[at], numbers.dtype.type(0))
