"""Read an image of HDF5 (.h5, .ims, MATLAB 7.3) or netCDF-4 (.nc), by h5py, in a child process (`isolation.py`).

A convention says which datasets are images, and gives the axes and the meaning of their numbers. `_CONVENTIONS` lists
the conventions; the last one describes any dataset. An image with levels is read like a store (`store.py`). No other
file is ever opened, except for the description of
BigDataViewer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from renderer.errors import InputError, require_package
from renderer.readers import hdf5_bdv, hdf5_cf, hdf5_emd, hdf5_imaris, hdf5_nexus
from renderer.readers.axis_letters import letters_of
from renderer.readers.components import choose
from renderer.readers.hdf5_image import Candidate, PlainImage, place_of
from renderer.readers.hdf5_levels import LevelsOfFile, Pyramid
from renderer.readers.hdf5_objects import check_dataset, decoded
from renderer.readers.hdf5_values import Values
from renderer.readers.image import Image
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.store import Wanted, choose_level, read_levels
from renderer.readers.units import units_of
from renderer.readers.voxel_limits import check_crop, check_size, describe_shape
from renderer.scene import did_you_mean, join_some, short_text
from renderer.stores import axis_named, slabs_of
from renderer.volume import Array

# The functions that find the images of a file, one for each convention, in the order in which they are tried.
_CONVENTIONS = (
    hdf5_imaris.find_images,
    hdf5_bdv.find_images,
    hdf5_nexus.find_images,
    hdf5_emd.find_images,
    hdf5_cf.find_images,
)


def read_hdf5(path: Path, *, has_spacing_override: bool, host: Host, **wanted: Any) -> Image:
    """Read a part of the named image, or of the only image if none is named.

    has_spacing_override: the scene gives the spacing, so that coordinates need not be even. wanted: the fields of
        `Wanted`. Raises InputError for files that are damaged, hold no such image or several, or whose voxels are in
        other files.
    """
    require_package("h5py", extra="hdf5")
    import h5py

    part = Wanted(**wanted)
    with h5py.File(path, "r", locking=False) as file:
        found = _only(file) if part.dataset is None else _named(file, part.dataset)
        image = found.describe()
        if isinstance(image, Pyramid):
            return read_levels(LevelsOfFile(image, file, path, found.name), part, host)
        check_dataset(image.dataset, path)
        name = found.name if part.dataset is None else None
        return _plain_image(image, part, has_spacing_override=has_spacing_override, host=host, only_name=name)


def _plain_image(
    image: PlainImage, wanted: Wanted, *, has_spacing_override: bool, host: Host, only_name: str | None
) -> Image:
    """Return the wanted part of an image of one dataset. only_name: the name of an image that the scene does not name.

    Only the chunks of a crop are read.
    """
    axes = [axis_named(axis.name, axis.unit) for axis in image.axes]
    letters = letters_of(axes, image.shape, wanted.time, wanted.component)
    chosen = choose(letters, image.shape, wanted.time, wanted.component)
    meaning = image.values(image.dataset)
    lengths = tuple(n for n, item in zip(image.shape, chosen.part, strict=True) if isinstance(item, slice))[::-1]
    shape_xyz = (*lengths, *[1] * (3 - len(lengths)))
    choose_level([check_size(shape_xyz, meaning.dtype)], wanted.level, math.inf)
    box = None
    if wanted.crop is not None:
        box = tuple((pair[0], pair[1]) if pair else (0, n) for pair, n in zip(wanted.crop, shape_xyz, strict=True))
        check_crop(box, shape_xyz)
    ranges = iter((box or tuple((0, n) for n in shape_xyz))[: len(lengths)][::-1])
    part = [slice(*next(ranges)) if isinstance(item, slice) else item for item in chosen.part]
    values = _read(image.dataset, part, meaning, host)
    world_from_index, length, notes = place_of(image, letters, has_spacing_override)
    steps = image.axes[letters.index("t")].times() if "t" in letters else chosen.steps
    note = f"the only volume in this file, {short_text(only_name)}, is read" if only_name is not None else None
    return Image(
        values,
        world_from_index,
        (note, *image.notes, *notes, *chosen.notes),
        meaning.nodata,
        chosen.channels,
        meaning.labels,
        steps,
        units_of(length, value=meaning.unit),
        box=box,
    )


def _read(source: Any, part: Sequence[int | slice], meaning: Values, host: Host) -> Array:
    """Return the values [z, y, x] of a part of a dataset."""
    shape = tuple(item.stop - item.start for item in part if isinstance(item, slice))
    values = allocate_voxels(host, (1,) * (3 - len(shape)) + shape, meaning.dtype)
    for own, target in slabs_of(part, values.reshape(shape), source.chunks or (1,) * source.ndim):
        stored = decoded(source, own)
        if not meaning.is_scaled:
            target[...] = stored.view(target.dtype)
            continue
        for plane, own_plane in zip(target, stored, strict=True):  # of one plane at a time, values are float64
            plane[...] = meaning.of(own_plane)
    return values


def _candidates(file: Any) -> Iterator[list[Candidate]]:
    """Yield the images that each convention finds, for the conventions that find any."""
    yield from filter(None, (find(file) for find in _CONVENTIONS))


def _only(file: Any) -> Candidate:
    """Return the only image of a file, by the first convention that finds one.

    Raises InputError if there are several, or none.
    """
    planes: list[Candidate] = []
    for found in _candidates(file):
        images = [each for each in found if not each.is_part]
        if len(images) == 1:
            return images[0]
        if images:
            raise InputError(
                f"this file holds {len(images)} volumes, and one is rendered",
                got=join_some(_listed(images)),
                expected=f"`dataset: NAME`, such as `dataset: {short_text(min(each.name for each in images))}`",
            )
        planes = found
    raise InputError(
        "this file holds no volume",
        got=join_some(_listed(planes)) if planes else "no dataset of numbers with two axes or more",
        expected="a dataset of three axes" + ", or `dataset: NAME` for a plane" * bool(planes),
    )


def _named(file: Any, name: str) -> Candidate:
    """Return the image called `name`; raises InputError if there is none."""
    every = [each for found in _candidates(file) for each in found]
    for each in every:
        if each.name == name.strip("/"):
            return each
    shown = [each for each in every if not each.is_part] or every
    listed = list(dict.fromkeys(_listed(shown)))
    raise InputError(
        "there is no such dataset of numbers",
        got=f"dataset: {short_text(name)}",
        expected=join_some(listed) if listed else "a file with a dataset of two axes or more",
        hint=did_you_mean(name[:200], [each.name for each in every]),
    )


def _listed(images: list[Candidate]) -> list[str]:
    return [f"{short_text(each.name)} ({describe_shape(each.shape[::-1])})" for each in images]
