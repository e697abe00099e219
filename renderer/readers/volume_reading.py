"""Read the volume that a `VolumeSpec` describes: choose the reader of its format, then crop and check the voxels."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache, partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import GUESSED_LENGTHS, check_axes, check_lengths, spacing_of, with_spacing
from renderer.readers.components import are_colors, are_light, choose, select_index
from renderer.readers.file_errors import errors_about, require_exists, unreadable_error
from renderer.readers.image import Image
from renderer.readers.isolation import import_reader, read_isolated
from renderer.readers.kept_levels import find_kept, read_kept, read_part_kept, read_plan, store_state
from renderer.readers.level_parts import has_blocks
from renderer.readers.nodata import find_fill_values, mark_absent
from renderer.readers.recent_images import FileMarks, ImageRequest, RecentImages
from renderer.readers.sniff import find_volume
from renderer.readers.steps_in_time import TimeSteps, some_steps
from renderer.readers.store_blocks import Blocks
from renderer.readers.units import Units, units_of
from renderer.readers.volume_files import ISOLATED, marks_of_volume, marks_with_header
from renderer.readers.voxel_colors import join_colors
from renderer.readers.voxel_limits import (
    MAX_VOLUME_BYTES,
    check_crop,
    check_dtype,
    check_integer_resolution,
    check_memory,
    describe_shape,
    stays_mapped,
)
from renderer.scene import ArraySource, FileSource, ProceduralSource, RawSource, UrlSource, VolumeSpec, short_text
from renderer.stores import is_store, is_zipped_store
from renderer.system import free_bytes
from renderer.volume import Array, Float64, MappedFile, Volume, backing_file, guard_mapping, make_volume

# A function that reads the volume that a `VolumeSpec` describes.
ReadVolume = Callable[[VolumeSpec], Volume]
Ranges = Sequence[tuple[int, int]]
# The share of the free memory that the kept images may take. Bricks may take half of the memory that is then
# still free.
_SHARE_OF_FREE = 1 / 8
# The share of the free memory that the voxels of a level of a store may take, if the scene does not choose the level.
# Their bricks, and copies for voxels without data, take about as much again.
_SHARE_OF_LEVEL = 1 / 4
# The sources with a place of their own, whose spacing a scene may replace.
_WITH_SPACING = (FileSource, UrlSource, ArraySource)
# The number of bytes that kept images may take if the system does not say how much memory is free.
_KEPT_BYTES_IF_UNKNOWN = 256 << 20
# The share of the free room on the disk of temporary files that kept images may take there.
_SHARE_OF_DISK = 1 / 4


def _most_kept_bytes(is_on_disk: bool) -> float:
    """Return the largest number of bytes that kept images may take now, on disk or in memory."""
    if is_on_disk:
        return _SHARE_OF_DISK * shutil.disk_usage(tempfile.gettempdir()).free
    free = free_bytes()
    return _KEPT_BYTES_IF_UNKNOWN if math.isinf(free) else _SHARE_OF_FREE * free


# The cache of images. The look, the fingerprint, the framing and the drawing of a film need the same steps in time.
_RECENT_IMAGES = RecentImages(_most_kept_bytes)


def read_volume(spec: VolumeSpec, like: Volume | None = None) -> Volume:
    """Return the volume that `spec` describes, cropped, checked and read-only; a mixture for a time between two steps.

    `time: auto` reads the first step. A crop moves the affine along, so that voxels keep their place in the world.
    `component: all` reads the first component, without a note on the others if each is light of its own or part of a
    colour.

    like: another step, which must have the same shape and kind of voxels. Raises InputError for every problem with a
    file or with the requested part of it, lack of memory included. A large file that becomes shorter, now or later,
    raises such an error, too; no signal ends the process.
    """
    time = 0 if spec.time == "auto" else spec.time
    step = None if time is None else math.floor(time)
    volume = _read_step(spec, step)
    if like is not None:
        _check_alike(volume, like, by_kind=not spec.interpolate)
    return volume if time is None or time == step else mix_steps(volume, _read_step(spec, int(time) + 1), time % 1.0)


def _read_step(spec: VolumeSpec, time: int | None) -> Volume:
    name = _name(spec.source, time)
    # Numbers of headers may be infinite. An affine that is not finite is refused, and such values have no data.
    with errors_about(name), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        try:
            return _read_volume(spec, time, name)
        except OSError as error:
            raise unreadable_error(error) from error
        except MemoryError as error:
            raise InputError(
                "there is not enough memory for this volume", hint="`crop` it, or render on a larger machine"
            ) from error


def _check_alike(volume: Volume, like: Volume, *, by_kind: bool = True) -> None:
    """Raise InputError unless a step has the shape and the type of another step.

    by_kind: whether to compare types. They are not compared if voxels are absent, as these turn integers into floats.
    """
    by_kind = by_kind and not volume.num_absent and not like.num_absent
    got, expected = (
        f"{describe_shape(each.shape_xyz)} voxels{f' of {each.values.dtype.name}' * by_kind}" for each in (volume, like)
    )
    if got != expected:
        what = "the steps of this volume differ"
        raise InputError(what, where=volume.name, got=got, expected=f"{expected}, as in {like.name}")


def mix_steps(before: Volume, after: Volume, share: float) -> Volume:
    """Return a volume between two steps on one grid, float32; a voxel is absent if it is absent in either step.

    share: the weight of the second step. Raises InputError for steps on different grids.
    """
    _check_alike(after, before)
    places = before.world_from_index, after.world_from_index
    if not np.allclose(*places, rtol=0.0, atol=1e-4 * before.finest_spacing):
        got = f"first voxels at {', '.join(str(place[:3, 3].tolist()) for place in places)}"
        expected = f"the spacing, origin and directions of {before.name}"
        raise InputError("two steps on different grids are not mixed", where=after.name, got=got, expected=expected)
    check_memory(4 * before.values.size)
    values = np.empty(before.values.shape, np.float32)
    with np.errstate(over="ignore"):
        for plane, first, second in zip(values, before.values, after.values, strict=True):
            plane[...] = _between(first, second, share)
    for each in (before, after):
        each.require_unchanged()
    num_absent = int(np.count_nonzero(np.isnan(values)))
    if num_absent == values.size or np.isinf(values).any():
        what = "no voxel has data in two steps" if num_absent else "these values are too large to be mixed"
        raise InputError(what, where=after.name, got=f"a mixture with {before.name}")
    colors = None
    if before.colors is not None and after.colors is not None:
        colors = np.rint(_between(before.colors, after.colors, share)).astype(np.uint8)
    made = make_volume(values, before.world_from_index, before.name, num_absent=num_absent, colors=colors)
    mixed = replace(before, values=values, num_absent=num_absent, colors=colors)
    return replace(mixed, digest=made.digest, source=None, is_on_disk=False)


def _between(before: Array, after: Array, share: float) -> Float64:
    return np.asarray(before.astype(np.float64) * (1.0 - share) + after.astype(np.float64) * share)


def _read_volume(spec: VolumeSpec, time: int | None, name: str) -> Volume:
    image, replaced = _with_spacing(_load(spec, time), spec)
    crop, lengths = spec.crop or (None, None, None), image.values.shape[::-1]
    ranges = image.box or tuple(pair or (0, length) for pair, length in zip(crop, lengths, strict=True))
    image, colors = crop_image(image, ranges), None
    if isinstance(spec.component, str) and spec.has_colors:
        image, colors = join_colors(
            image, spec.component, lambda k: crop_image(_load(replace(spec, component=k), time), ranges)
        )
    notes = [each for each in image.notes if each and (replaced is None or not each.startswith(GUESSED_LENGTHS))]
    is_light = are_light(image)
    if spec.component == "all" and (is_light or are_colors(image.values.dtype, image.channels)):
        notes = [each for each in notes if not each.startswith(f"{len(image.channels)} components")]
    first = tuple(begin for begin, _ in ranges)
    mapped = _file_of(image) if stays_mapped(image.values.nbytes) else None
    if mapped is not None:
        guard_mapping(mapped, image.values)
    values = _native_contiguous(image.values)
    image = replace(image, values=values, is_on_disk=image.is_on_disk and np.may_share_memory(values, image.values))
    file = _file_of(image)
    elsewhere = _fill_values_in_time(spec, image) if spec.nodata == "auto" else ()
    values, num_absent, note = mark_absent(image.values, file, spec.nodata, image.nodata, first, elsewhere)
    if mapped is not None:  # also a copy is checked, as its file may have become shorter meanwhile
        mapped.require_unchanged()
    file, is_on_disk = (file, image.is_on_disk) if values is image.values else (None, False)
    check_integer_resolution(values, file)
    made = make_volume(values, image.world_from_index, name, file, num_absent=num_absent, colors=colors)
    channels = tuple(replace(each, is_light=is_light) for each in image.channels)
    remarks = "; ".join([*notes, *filter(None, [note])]) or None
    named = replace(made, file_spacing=replaced, note=remarks, channels=channels, labels=image.labels)
    finest_share = min(spacing_of(_finest_affine(image))) / min(spacing_of(image.world_from_index))
    named = replace(named, levels=image.levels, finest_share=finest_share, is_on_disk=is_on_disk)
    is_guessed = not image.has_lengths or any((each or "").startswith(GUESSED_LENGTHS) for each in image.notes)
    named = replace(named, has_lengths=replaced is not None or not is_guessed)
    # The scene's spacing may be in any unit. If it differs from the file's, the file's unit is not kept.
    finest_spacing = spacing_of(_finest_affine(image))
    are_own = replaced is None or np.allclose(finest_spacing, replaced, rtol=1e-3, atol=0.0)
    units = units_of(spec.unit or image.units.length_unit * bool(are_own), *image.units[1:])
    return replace(named, **image.steps._asdict(), **units._asdict())


def _file_of(image: Image) -> MappedFile | None:
    """Return the file that the values of an image are mapped from, None for values in memory and in temporary files.

    An entry of the cache folder may be removed at any time: its voxels stay.
    """
    try:
        file = backing_file(image.values)
    except FileNotFoundError:
        if image.is_on_disk:
            return None
        raise
    return replace(file, may_go=image.is_on_disk) if file is not None else None


def _with_spacing(image: Image, spec: VolumeSpec) -> tuple[Image, tuple[float, float, float] | None]:
    """Return an image with the spacing that a scene gives, and the spacing that it replaces; raises InputError."""
    check_dtype(image.values.dtype)
    check_axes(image.world_from_index)
    spacing, replaced = spec.source.spacing if isinstance(spec.source, _WITH_SPACING) else None, None
    if spacing is not None:
        finest = _finest_affine(image)
        replaced = spacing_of(finest)
        index = np.eye(4) if image.finest_from_index is None else image.finest_from_index
        image = replace(image, world_from_index=with_spacing(finest, spacing) @ index)
    check_lengths(image.world_from_index)
    return image, replaced


def _finest_affine(image: Image) -> Float64:
    """Return the affine of the finest level of an image's store, float64 [4, 4]; of another image its own."""
    if image.finest_from_index is None:
        return image.world_from_index
    return np.asarray(image.world_from_index @ np.linalg.inv(image.finest_from_index))


def read_part(spec: VolumeSpec, blocks: Blocks | None) -> Image | None:
    """Return a level of a store with some of its blocks, placed in the world; or the whole level, if it is kept.

    The voxels are mapped from a temporary file, or from the cache folder. Blocks that this process has read, or that
    the cache folder has, are not read again. blocks: the blocks of the level that the spec names; None to read no
    voxels. Returns None for a volume that is no store. Raises InputError for damaged stores.
    """
    found = _store_of(spec)
    if found is None:
        return None
    with errors_about(str(found)):
        image = _part(spec, found, blocks)
        assert image.box is not None
        return crop_image(_with_spacing(image, spec)[0], image.box)


def state_of_store(spec: VolumeSpec) -> object:
    """Return facts that change when a store does; their `repr` tells stores apart. None for a volume that is no store.

    Of a store at a URL, only the metadata are known. Raises InputError for damaged stores.
    """
    found = _store_of(spec)
    if found is None:
        return None
    with errors_about(str(found)):
        return store_state(partial(_part, spec, found, None), found)


def _store_of(spec: VolumeSpec) -> Path | str | None:
    """Return the path or the URL of the store of a volume; None for a volume that is no store."""
    source = spec.source
    if isinstance(source, UrlSource):
        return source.url
    if not isinstance(source, FileSource) or source.steps:
        return None
    with errors_about(str(source.file)):
        place = find_volume(require_exists(source.file))[0]
        return place if is_store(place) or is_zipped_store(place) else None


def _part(spec: VolumeSpec, place: Path | str, blocks: Blocks | None) -> Image:
    """Return a level of a store with some of its blocks, and those that this process has read before."""
    time = math.floor(spec.time) if isinstance(spec.time, (int, float)) else None
    wanted = _wanted(spec, 0 if spec.time == "auto" else time)
    read = partial(read_isolated, "renderer.readers.store:read_store", place, on_disk=True, **wanted)
    request = _part_request(spec, place, wanted)
    part = _RECENT_IMAGES.get(request, lambda: read_plan(read, place, wanted))
    if blocks is None or has_blocks(part, blocks):
        return part
    whole = _RECENT_IMAGES.find(_level_request(spec, place, "store", wanted)) or find_kept(part, place, wanted)
    if whole is not None:
        return whole
    return _RECENT_IMAGES.keep(request, read_part_kept(part, blocks, read, place, wanted))


def _fill_values_in_time(spec: VolumeSpec, image: Image) -> tuple[float, ...]:
    """Return the fill values of some steps in time of a volume.

    Returns an empty tuple for a volume of one step, and for values of one byte.
    """
    num_times, source = image.steps.num_times, spec.source
    if num_times == 1 or image.values.dtype.itemsize == 1 or not isinstance(source, (FileSource, UrlSource)):
        return ()
    crop = None if image.box is None else spec.crop  # of a store, only the chunks of the crop are read
    alike = VolumeSpec(source, component=_component(spec), dataset=spec.dataset, level=spec.level, crop=crop)
    if isinstance(source, UrlSource):
        return _found_fill_values(alike, num_times, ())
    of_files = chain.from_iterable(map(marks_with_header, source.steps or (source.file,)))
    return _found_fill_values(alike, num_times, tuple(of_files))


@lru_cache(maxsize=16)
def _found_fill_values(spec: VolumeSpec, num_times: int, _of_files: tuple[FileMarks, ...]) -> tuple[float, ...]:
    """Return the fill values of some steps, in ascending order. _of_files: the marks of the files, for the cache.

    A step that cannot be read counts as one without fill values; the error is raised when the step is drawn.
    """
    found = set[float]()
    for step in some_steps(num_times):
        with suppress(InputError, OSError):
            values = _native_contiguous(_load(spec, step).values)
            if (file := backing_file(values)) is not None:
                guard_mapping(file, values)
            found.update(find_fill_values(values, file))
    return tuple(sorted(found))


def _name(source: FileSource | UrlSource | RawSource | ProceduralSource | ArraySource, time: int | None) -> str:
    if isinstance(source, FileSource) and source.steps:
        return str(source.steps[min(time or 0, len(source.steps) - 1)])
    if isinstance(source, ArraySource):
        return source.name
    if isinstance(source, UrlSource):
        return source.url
    return f"procedural {source.name}" if isinstance(source, ProceduralSource) else str(source.file)


def _load(spec: VolumeSpec, time: int | None) -> Image:
    """Return the image of one step from the reader of its source, which is imported on first use."""
    source = spec.source
    if isinstance(source, FileSource):
        return _load_listed(spec, source, time) if source.steps else _load_file(spec, source.file, time)
    if isinstance(source, UrlSource):
        return _load_part(spec, source.url, "store", time)
    select_index("time", time, 1)
    select_index("component", _component(spec), 1)
    if isinstance(source, ArraySource):
        values = source.values.view()
        values.flags.writeable = False  # a view, so that the caller's array stays writeable
        is_placed, place = source.affine is not None, np.array(np.eye(4) if source.affine is None else source.affine)
        return Image(values, place, units=Units(source.unit, source.world_axes), has_lengths=is_placed)
    if isinstance(source, RawSource):
        from renderer.readers.numpy_arrays import map_raw

        values = map_raw(source)
    else:
        from renderer.readers.procedural import procedural_values

        values = procedural_values(source)
    return Image(values, np.diag([*source.spacing, 1.0]))


# The modules of readers that are not named after their format; `nrrd.py` has `read_nrrd`, and so on.
_MODULES = {"npy": "numpy_arrays", "npz": "numpy_arrays", "vtk": "vtk_image"}
# The formats with several images or levels, of which only the voxels of a crop are read.
_IN_PARTS = ("store", "hdf5")


def _load_listed(spec: VolumeSpec, source: FileSource, time: int | None) -> Image:
    """Return the image of one of several files; each file is a step in time."""
    chosen = choose("t", (len(source.steps),), time, None)
    file = source.steps[chosen.step]
    # If the scene chooses a component, a fourth axis without a name is components, not time.
    own_time = 0 if spec.component is None else None
    image = _load_file(spec, file, own_time)
    if image.steps.num_times > 1:
        got = f"{image.steps.num_times} time steps in this one"
        hint = "name it alone: `file` without a list or a pattern"
        raise InputError("a step in time is one volume", where=str(file), got=got, expected="one", hint=hint)
    steps = TimeSteps(len(source.steps), source.times)
    return replace(image, steps=steps, notes=(*image.notes, *chosen.notes))


def _load_file(spec: VolumeSpec, path: Path, time: int | None) -> Image:
    """Return the image in a file or a folder, from the reader of its format."""
    found, form, note = find_volume(require_exists(path))
    load = _load_part if form in _IN_PARTS else _load_whole
    image = load(spec, found, form, time)
    return replace(image, notes=(note, *image.notes))


def _load_whole(spec: VolumeSpec, found: Path, form: str, time: int | None) -> Image:
    """Return a step and a component of an image without levels, which its reader reads whole."""
    reader = f"renderer.readers.{_MODULES.get(form, form)}:read_{form}"  # imported on first use
    if spec.dataset is not None:
        raise InputError(
            "there is no such dataset",
            where=str(found),
            got=f"dataset: {short_text(spec.dataset)}",
            expected="no `dataset` at all: only HDF5 and netCDF-4 files, and stores, have them",
        )
    if spec.level is not None:
        got, expected = f"level: {spec.level}", "no `level` at all: only stores, Imaris and BigDataViewer have levels"
        raise InputError("there is no such level", where=str(found), got=got, expected=expected)
    component, has_spacing = _component(spec), _has_spacing(spec)

    def read() -> Image:
        if form in ISOLATED:
            return read_isolated(reader, found, time=time, component=component, has_spacing_override=has_spacing)
        with errors_about(found):
            image = import_reader(reader)(found, time, component)
        stays = stays_mapped(image.values.nbytes) and backing_file(image.values) is not None
        return image if stays else replace(image, values=_native_contiguous(image.values))

    choice = (found.resolve(), time, component, has_spacing)
    return _RECENT_IMAGES.get(ImageRequest(spec.source, choice, marks_of_volume(found, form)), read)


def _load_part(spec: VolumeSpec, place: Path | str, form: str, time: int | None) -> Image:
    """Return the image in a store or in HDF5: its level, and the voxels of the crop alone. place: a path, or a URL."""
    wanted = _wanted(spec, time)
    if form == "hdf5":
        wanted["has_spacing_override"] = _has_spacing(spec)
    reader = f"renderer.readers.{form}:read_{form}"
    read = partial(read_isolated, reader, place, on_disk=True, **wanted, most_bytes=most_level_bytes())
    request = _level_request(spec, place, form, wanted)
    if form != "store":
        return _RECENT_IMAGES.get(request, read)
    part = _part_request(spec, place, wanted)
    image = _RECENT_IMAGES.get(request, lambda: read_kept(read, _RECENT_IMAGES.find(part), place, wanted))
    _RECENT_IMAGES.drop(part)
    return image


def _level_request(spec: VolumeSpec, place: Path | str, form: str, wanted: Mapping[str, Any]) -> ImageRequest:
    """Return the request for an image in a store or in HDF5. wanted: the part of it, as in `Wanted`."""
    marks = () if isinstance(place, str) else marks_of_volume(place, form)
    choice = (place if isinstance(place, str) else place.resolve(), *wanted.values())
    return ImageRequest(spec.source, choice, marks)


def _part_request(spec: VolumeSpec, place: Path | str, wanted: Mapping[str, Any]) -> ImageRequest:
    """Return the request for a part of a level of a store."""
    request = _level_request(spec, place, "store", wanted)
    return replace(request, choice=("part", request.choice))


def _wanted(spec: VolumeSpec, time: int | None) -> dict[str, Any]:
    """Return the scene's choices of a part of an image, as fields of `Wanted`."""
    component = _component(spec)
    return {"time": time, "component": component, "dataset": spec.dataset, "level": spec.level, "crop": spec.crop}


def most_level_bytes() -> float:
    """Return the largest number of bytes that the voxels of a level may take now."""
    free = free_bytes()
    # A finest level of unknown size is read whole if the system does not say how much memory is free.
    return _SHARE_OF_LEVEL * free if math.isfinite(free) else float(MAX_VOLUME_BYTES)


def _has_spacing(spec: VolumeSpec) -> bool:
    """Return whether the scene gives a spacing, so that wrong lengths in the file do not matter."""
    return isinstance(spec.source, FileSource) and spec.source.spacing is not None


def _component(spec: VolumeSpec) -> int | None:
    """Return the component that is read first: 0 for all components and for colours, None if the scene chooses none."""
    if spec.has_colors:
        return 0
    return spec.component if isinstance(spec.component, int) else None


def crop_image(image: Image, ranges: Ranges) -> Image:
    """Return the voxels in half-open `ranges` along x, y and z, at the same place in the world; the values are a view.

    The values of an image that its reader has cropped stay. Raises InputError for ranges that are empty or reach
    outside the volume.
    """
    if image.box is None:
        check_crop(ranges, image.values.shape[::-1])
    (x0, x1), (y0, y1), (z0, z1) = ranges
    world_from_index = image.world_from_index.copy()
    world_from_index[:3, 3] += image.world_from_index[:3, :3] @ np.array([x0, y0, z0], np.float64)
    values = image.values if image.box is not None else image.values[z0:z1, y0:y1, x0:x1]
    return replace(image, values=values, world_from_index=world_from_index)


def _native_contiguous(values: Array) -> Array:
    """Return the values in native byte order and C order.

    Large arrays that a file stores in this form stay mapped. Others get memory of their own, so that no larger array
    stays in memory.
    """
    is_mapped = isinstance(values, np.memmap)
    if is_mapped and stays_mapped(values.nbytes) and values.flags.c_contiguous and values.dtype.isnative:
        return np.asarray(values)
    is_part = values.base is not None and getattr(values.base, "nbytes", values.nbytes) > values.nbytes
    if is_mapped or is_part or not values.flags.c_contiguous:
        return np.array(values, values.dtype.newbyteorder("="), order="C")
    if not values.dtype.isnative:
        swapped: Array = (values if values.flags.writeable else values.copy()).byteswap(inplace=True)
        return swapped.view(values.dtype.newbyteorder("="))
    return values
