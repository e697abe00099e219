"""Find the files that a job reads, so that no output replaces or joins them."""

from __future__ import annotations

import contextlib
import glob
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from renderer.errors import InputError
from renderer.film import folder_files
from renderer.scene import (
    ArraySource,
    FileSource,
    FilmScene,
    OutputFile,
    ProceduralSource,
    UrlSource,
    VolumeSpec,
    place_of,
)


def scene_files(scene: FilmScene) -> Iterator[Path]:
    """Yield the files that a scene names: of annotation, imported transfer functions, volumes, and names of labels."""
    first = scene.at(0)
    yield from first.annotation.files
    for layer in first.layers:
        imported = layer.transfer_function.imported
        if imported is not None and imported.file is not None:
            yield imported.file
        for volume in layer.volumes.values():
            yield from volume_files(volume)
        for labels in (layer.transfer_function.labels, layer.mask.labels if layer.mask else None):
            if labels is not None and isinstance(labels.names, Path):
                yield labels.names


def volume_files(volume: VolumeSpec) -> Iterator[Path]:
    """Yield the files of all steps of a volume, with the data files of a header and the slices of a folder."""
    source = volume.source
    if isinstance(source, (ProceduralSource, UrlSource)):
        return
    if isinstance(source, ArraySource):
        from renderer.volume import backing_file

        with contextlib.suppress(OSError):
            mapped = backing_file(source.values)
            yield from [] if mapped is None else [mapped.path]
        return
    if isinstance(source, FileSource) and source.collection is not None:
        yield source.collection
    for file in (source.steps if isinstance(source, FileSource) else ()) or (source.file,):
        yield file
        if os.path.isdir(file):
            yield from _slices(file)
            yield from _files_of_volume_inside(file)
        elif isinstance(source, FileSource):
            header, voxels = _header_and_voxel_files(file)
            yield header
            yield from voxels


def require_no_new_slices(outputs: Iterable[OutputFile], scene: FilmScene) -> None:
    """Raise InputError if the pictures of an output would become slices of a volume that is a folder of pictures."""
    pictures = [each for each in outputs if each.is_frames]
    if not pictures:
        return
    folders = {place_of(folder): folder for folder in _picture_folders(scene)}
    for each in pictures:
        folder = folders.get(place_of(each.file.parent))
        if folder is not None:
            raise InputError(
                "this output would become a slice of an input",
                where=str(each.file),
                got=f"a picture in {folder}",
                expected="another folder",
                hint="give the output another folder",
            )


def _picture_folders(scene: FilmScene) -> Iterator[Path]:
    """Yield the folders of pictures that are the slices of a volume or a mask."""
    from renderer.readers import find_volume

    sources = [volume.source for layer in scene.at(0).layers for volume in layer.volumes.values()]
    for source in (source for source in sources if isinstance(source, FileSource)):
        for folder in filter(os.path.isdir, source.steps or (source.file,)):
            with contextlib.suppress(InputError, OSError):  # the reader of volumes reports the error later
                found, form, _ = find_volume(folder)
                if form == "pictures":
                    yield found


def _slices(folder: Path) -> Iterator[Path]:
    """Yield the slices directly in a folder. Other files, such as a film, may lie among them."""
    from renderer.readers import TIFF_SUFFIXES

    entries = list(folder_files(folder))
    tiffs = [entry for entry in entries if entry.suffix.lower() in TIFF_SUFFIXES]
    yield from tiffs or filter(_may_be_dicom, entries)


def _may_be_dicom(path: Path) -> bool:
    from renderer.readers import is_dicom

    with contextlib.suppress(InputError, OSError):
        return is_dicom(path)
    return True  # the file cannot be read; the reader of volumes reports the error later


def _files_of_volume_inside(folder: Path) -> Iterator[Path]:
    """Yield the files of the only volume below a folder, or the pictures or masks in it that are one volume."""
    from renderer.readers import find_volume, masks_in, slices_of_pictures

    with contextlib.suppress(InputError, OSError):  # the reader of volumes reports the error later
        found, form, _ = find_volume(folder)
        if found != folder:
            yield from volume_files(VolumeSpec(FileSource(found)))
        elif form == "pictures":
            yield from slices_of_pictures(folder)
        elif form == "masks":
            yield from masks_in(folder)


def expand_pattern(name: str) -> list[Path]:
    """Return the sorted files that match a pattern such as `scans/**/*.nrrd`.

    The name of a file that exists, and any name that is no pattern, is returned as it is. Raises InputError for a
    pattern without a match.
    """
    if Path(name).exists() or not glob.has_magic(name):
        return [Path(name)]
    found = sorted(glob.glob(name, recursive=True))
    if not found:
        hint = None if Path(name).is_absolute() else f"it is relative to {Path.cwd()}"
        raise InputError("no file matches this pattern", where=name, hint=hint)
    return [Path(path) for path in found]


def header_data_files(header: Path) -> list[Path]:
    """Return the files that have the voxels of a header, with links resolved; the header itself may be one of them.

    Return no files if the file is no header.
    """
    found, voxels = _header_and_voxel_files(header)
    return [file.resolve() for file in voxels] if found == header else []


def _header_and_voxel_files(file: Path) -> tuple[Path, list[Path]]:
    from renderer.readers import header_and_voxel_files

    with contextlib.suppress(InputError, OSError):  # the reader of volumes reports the error later
        if file.is_file():  # opening a pipe would wait for its writer
            return header_and_voxel_files(file)
    return file, []
