"""Write stores: the arrays by tensorstore, and the metadata of OME by hand."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tensorstore

from renderer.volume import Array

# The number of voxels along z, y and x of the finest level, none of them a multiple of a chunk.
SHAPE = (12, 14, 18)
AXES = {
    "t": {"name": "t", "type": "time", "unit": "second"},
    "c": {"name": "c", "type": "channel"},
    **{name: {"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"},
}


def field(shape: Sequence[int] = SHAPE, dtype: str = "uint16") -> Array:
    """Return an array of numbers that all differ, as far as the type has them."""
    return np.arange(np.prod(shape)).reshape(shape).astype(dtype)


def write_array(folder: Path, values: Array, *, version: int = 2, chunks: Sequence[int] = (), **metadata: Any) -> None:
    """Write an array of Zarr. chunks: by default 5 along each axis, and 1 along the fourth and fifth from the end."""
    size = list(chunks or [1] * (values.ndim - 3) + [5] * min(values.ndim, 3))
    own: dict[str, Any]
    if version == 2:
        own = {"shape": values.shape, "chunks": size, "dtype": values.dtype.str, **metadata}
    else:
        grid = {"name": "regular", "configuration": {"chunk_shape": size}}
        own = {"shape": values.shape, "data_type": values.dtype.name, "chunk_grid": grid, **metadata}
    kvstore = {"driver": "file", "path": f"{folder}/"}
    spec = {"driver": {2: "zarr", 3: "zarr3"}[version], "kvstore": kvstore, "metadata": own}
    tensorstore.open(spec, create=True).result().write(values).result()


def sharded(*inner: int) -> list[dict[str, Any]]:
    """Return the codecs of shards with inner chunks and checksums."""
    codecs = [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}]
    return [{"name": "sharding_indexed", "configuration": {"chunk_shape": list(inner), "codecs": codecs}}]


def write_json(file: Path, fields: Mapping[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(fields))


def scaled(*scale: float, translation: Sequence[float] = ()) -> list[dict[str, Any]]:
    """Return the coordinate transformations of a level."""
    moved = [{"type": "translation", "translation": list(translation)}] * bool(translation)
    return [{"type": "scale", "scale": list(scale)}, *moved]


def write_ome(
    folder: Path,
    levels: Sequence[Array],
    places: Sequence[Any],
    *,
    axes: str = "zyx",
    version: str = "0.4",
    fields: Mapping[str, Any] = {},
    image: Mapping[str, Any] = {},
    **options: Any,
) -> Path:
    """Write an image of OME. places: the transformations of each level. fields: further ones of the group.

    image: further fields of the image.
    """
    zarr = 2 if version == "0.4" else 3
    for number, values in enumerate(levels):
        write_array(folder / str(number), values, version=zarr, **options)
    datasets = [
        {"path": str(number)} | ({"coordinateTransformations": place} if place else {})
        for number, place in enumerate(places)
    ]
    named = [AXES[name] for name in axes]
    multiscale = {"axes": named, "datasets": datasets, **image}
    ome = {"multiscales": [multiscale], **fields}
    if zarr == 2:
        write_json(folder / ".zgroup", {"zarr_format": 2})
        write_json(folder / ".zattrs", ome)
    else:
        group = {"zarr_format": 3, "node_type": "group", "attributes": {"ome": {"version": version, **ome}}}
        write_json(folder / "zarr.json", group)
    return folder


def halves(values: Array, *factors: int) -> Array:
    """Return the means of blocks of voxels, rounded down; a last block may be smaller."""
    found = values.astype(np.float64)
    for axis, factor in enumerate(factors):
        starts = np.arange(0, found.shape[axis], factor)
        counts = np.diff([*starts, found.shape[axis]]).reshape([-1 if k == axis else 1 for k in range(found.ndim)])
        found = np.add.reduceat(found, starts, axis=axis) / counts
    return found.astype(values.dtype)


def zipped_store(folder: Path, file: Path) -> Path:
    """Write the files of a store into a ZIP archive, without compression."""
    with zipfile.ZipFile(file, "w") as archive:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            archive.write(path, path.relative_to(folder))
    return file


def write_n5(folder: Path, levels: Sequence[Array], attributes: Sequence[Mapping[str, Any]], **group: Any) -> Path:
    """Write an image of N5 with the levels s0, s1 and so on, of values [z, y, x]. attributes: of each level."""
    for number, (values, own) in enumerate(zip(levels, attributes, strict=True)):
        metadata = {
            "dimensions": values.shape[::-1],
            "blockSize": [5, 4, 3],
            "dataType": values.dtype.name,
            "compression": {"type": "gzip"},
        }
        spec = {"driver": "n5", "kvstore": {"driver": "file", "path": f"{folder}/s{number}/"}, "metadata": metadata}
        tensorstore.open(spec, create=True).result().write(values.T).result()
        file = folder / f"s{number}" / "attributes.json"
        write_json(file, json.loads(file.read_text()) | own)
    write_json(folder / "attributes.json", {"n5": "2.5.0", **group})
    return folder


def write_precomputed(folder: Path, levels: Sequence[Array], scales: Sequence[Mapping[str, Any]]) -> Path:
    """Write a volume of Neuroglancer of values [z, y, x]. scales: fields of each scale."""
    for number, (values, own) in enumerate(zip(levels, scales, strict=True)):
        fields = {
            "size": values.shape[::-1],
            "encoding": "raw",
            "chunk_size": [5, 4, 3],
            "resolution": [4, 4, 40],
            **own,
        }
        spec = {
            "driver": "neuroglancer_precomputed",
            "kvstore": {"driver": "file", "path": f"{folder}/"},
            "multiscale_metadata": {"type": "image", "data_type": values.dtype.name, "num_channels": 1},
            "scale_metadata": {**fields, **own, "key": f"scale{number}"},
        }
        written = tensorstore.open(spec, create=True).result()
        written[tensorstore.d[:].translate_to[0]].write(values.T[..., np.newaxis]).result()
    return folder
