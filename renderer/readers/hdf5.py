"""Read an image of HDF5 (.h5, .ims, MATLAB 7.3) or netCDF-4 (.nc), by h5py, in a child process (`isolation.py`).

A convention says which datasets are images, and gives the axes and the meaning of their numbers. `_CONVENTIONS` lists
the conventions; the last one describes any dataset. No other file is ever opened, except for the description of
BigDataViewer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers import hdf5_bdv, hdf5_cf, hdf5_emd, hdf5_imaris, hdf5_nexus
from renderer.readers.components import Chosen, choose
from renderer.readers.hdf5_image import Candidate, StoredImage, letters_of, place_of
from renderer.readers.hdf5_objects import check_dataset
from renderer.readers.hdf5_values import Values
from renderer.readers.image import Image
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.steps_in_time import TimeSteps
from renderer.readers.units import units_of
from renderer.readers.voxel_limits import describe_shape
from renderer.scene import did_you_mean, join_some, short_text
from renderer.volume import Array

# The functions that find the images of a file, one for each convention, in the order in which they are tried.
_CONVENTIONS = (
    hdf5_imaris.find_images,
    hdf5_bdv.find_images,
    hdf5_nexus.find_images,
    hdf5_emd.find_images,
    hdf5_cf.find_images,
)


def read_hdf5(
    path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host, dataset: str | None
) -> Image:
    """Read one time step and component of the named image, or of the only image if none is named.

    has_spacing_override: the scene gives the spacing, so that coordinates need not be even. Raises InputError for
        files that are damaged, hold no such image or several, or whose voxels are in other files.
    """
    require_package("h5py", extra="hdf5")
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        found = _only(file) if dataset is None else _named(file, dataset)
        image = found.describe()
        letters = letters_of(image.axes, time, component)
        names = [each.name for each in image.channels]
        chosen = choose(letters, image.shape, time, component, names if all(names) else ())
        source = image.dataset(*chosen.part[: image.num_outer])
        check_dataset(source, path)
        part = tuple(slice(0, axis.length) if isinstance(item, slice) else item
                     for axis, item in zip(image.axes, chosen.part, strict=True))[image.num_outer :]  # fmt: skip
        meaning = image.values(source)
        values = _read(source, part, meaning, host)
        world_from_index, length, notes = place_of(image, letters, has_spacing_override)
        steps = _steps(image, letters, chosen)
    note = f"the only volume in this file, {short_text(found.name)}, is read" if dataset is None else None
    return Image(
        values,
        world_from_index,
        (note, *image.notes, *notes, *chosen.notes),
        meaning.nodata,
        _channels(image, chosen),
        meaning.labels,
        steps,
        units_of(length, value=meaning.unit),
    )


def _read(source: Any, part: tuple[int | slice, ...], meaning: Values, host: Host) -> Array:
    """Return the values [z, y, x] of a part of a dataset."""
    shape = tuple(item.stop for item in part if isinstance(item, slice))
    values = allocate_voxels(host, (1,) * (3 - len(shape)) + shape, meaning.dtype)
    stored = values if meaning.is_scaled else values.view(source.dtype.newbyteorder("="))
    try:
        source.read_direct(stored.reshape(shape), np.s_[part])
    except OSError as error:
        raise InputError(
            "the voxels of this dataset cannot be decoded",
            got=short_text(" ".join(str(error).split())),
            hint="the file is damaged, or compressed by a filter that is not installed: `h5repack -f GZIP=4` "
            "compresses it by another",
        ) from error
    if meaning.is_scaled:
        for plane in values:
            plane[...] = meaning.of(plane)
    return values


def _steps(image: StoredImage, letters: str, chosen: Chosen) -> TimeSteps:
    """Return the steps in time: of the image itself, else of its axis of time, else of `chosen`."""
    if image.steps is not None:
        return image.steps
    return image.axes[letters.index("t")].times() if "t" in letters else chosen.steps


def _channels(image: StoredImage, chosen: Chosen) -> tuple[Any, ...]:
    """Return the channels that the image describes, without colours if two have the same; else those of `chosen`."""
    count = len(chosen.channels)
    if count < 2 or len(image.channels) != count:
        return chosen.channels
    tell_apart = len({each.color for each in image.channels}) == count
    return tuple(replace(each, color=each.color if tell_apart else None) for each in image.channels)


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
