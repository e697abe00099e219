"""Samples of stores: OME-Zarr, Zarr, N5 and volumes of Neuroglancer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from statement_samples import Sample, Samples, Writer
from store_files import AXES, field, scaled, write_array, write_json, write_n5, write_ome, write_precomputed

_VALUES = field((3, 4, 5), "int16")
_CHANNELS = np.stack([_VALUES, _VALUES + 100])
_NAMED = {"omero": {"channels": [{"label": "a", "color": "ff0000"}, {"label": "b", "color": "00ff00"}]}}
_BODY = ("inferior-to-superior", "posterior-to-anterior", "left-to-right")


def _ome(*axes: Mapping[str, Any], place: Any = (), **options: Any) -> Writer:
    """Return a writer of an image with one level. axes: the fields of the axes z, y and x."""
    image = {"axes": list(axes)} if axes else {}
    places = [list(place) or scaled(1.0, 1.0, 1.0)]
    return lambda folder: write_ome(folder / "a.zarr", [_VALUES], places, image=image, **options)


def _channels(**changed: Any) -> Writer:
    """Return a writer of an image with two channels. changed: fields of the second one."""
    both = [dict(each) for each in _NAMED["omero"]["channels"]]
    both[1] |= changed
    fields = {"omero": {"channels": both}}
    return lambda folder: write_ome(folder / "a.zarr", [_CHANNELS], [scaled(1, 1, 1, 1)], axes="czyx", fields=fields)


def _labels(**fields: Any) -> Writer:
    return _ome(fields={"image-label": fields})


def _plain(version: int = 2, *, values: Any = _VALUES, attributes: Mapping[str, Any] = {}, **metadata: Any) -> Writer:
    """Return a writer of an array of Zarr without OME."""

    def write(folder: Path) -> Path:
        write_array(folder / "a.zarr", values, version=version, **metadata)
        if attributes:
            write_json(folder / "a.zarr/.zattrs", attributes)
        return folder / "a.zarr"

    return write


def _n5(**attributes: Any) -> Writer:
    return lambda folder: write_n5(folder / "a.n5", [_VALUES], [attributes])


def _levels_of_n5(*factors: list[int]) -> Writer:
    attributes = [{"downsamplingFactors": each, "resolution": [1, 1, 1]} for each in factors]
    return lambda folder: write_n5(folder / "a.n5", [_VALUES, _VALUES[:, ::2, ::2]], attributes)


def _precomputed(**fields: Any) -> Writer:
    return lambda folder: write_precomputed(folder / "a", [_VALUES], [fields])


_ZYX = [AXES[name] for name in "zyx"]
_XYZ = _ZYX[::-1]
_NO_UNITS = [{"name": name, "type": "space"} for name in "zyx"]
_IN_BODY = [axis | {"orientation": {"type": "anatomical", "value": way}} for axis, way in zip(_ZYX, _BODY, strict=True)]
_COLORS = [{"label-value": 1, "rgba": [255, 0, 0, 255]}]
_TWO = {"component": 1}
SAMPLES: Samples = {
    "Stores (OME-Zarr, Zarr, N5, Neuroglancer)": {
        "axes": Sample(_ome(*_ZYX), _ome(*_XYZ)),
        "axes.unit": Sample(_ome(*_NO_UNITS), _ome(*_ZYX)),
        "axes.orientation": Sample(_ome(*_ZYX), _ome(*_IN_BODY)),
        "datasets.coordinateTransformations": Sample(_ome(), _ome(place=scaled(2, 2, 2))),
        "coordinateTransformations": Sample(
            _ome(), lambda folder: write_ome(folder / "a.zarr", [_VALUES], [scaled(1, 1, 1)],
                                             image={"coordinateTransformations": scaled(3, 3, 3)})
        ),
        "coordinateTransformations.type": Sample(_ome(), _ome(place=[{"type": "displacements", "path": "field"}])),
        "omero.channels.label": Sample(_channels(), _channels(label="c"), _TWO),
        "omero.channels.color": Sample(_channels(), _channels(color="0000ff"), _TWO),
        "omero.channels.window": Sample(_channels(), _channels(window={"start": 0, "end": 9}), _TWO),
        "omero.channels.active": Sample(_channels(), _channels(active=False), _TWO),
        "omero.channels.inverted": Sample(_channels(), _channels(inverted=True), _TWO),
        "image-label.colors": Sample(_labels(), _labels(colors=_COLORS)),
        "image-label.properties": Sample(_labels(), _labels(properties=[{"label-value": 1, "name": "a"}])),
        "_ARRAY_DIMENSIONS": Sample(
            _plain(values=_VALUES), _plain(values=_VALUES, attributes={"_ARRAY_DIMENSIONS": ["x", "y", "z"]})
        ),
        "dimension_names": Sample(_plain(3), _plain(3, dimension_names=["x", "y", "z"])),
        "_FillValue": Sample(_plain(), _plain(attributes={"_FillValue": 7})),
        "missing_value": Sample(_plain(), _plain(attributes={"missing_value": 7})),
        "scale_factor": Sample(_plain(), _plain(attributes={"scale_factor": 0.5})),
        "add_offset": Sample(_plain(), _plain(attributes={"add_offset": 5})),
        "pixelResolution": Sample(_n5(), _n5(pixelResolution={"dimensions": [2, 2, 3], "unit": "um"})),
        "downsamplingFactors": Sample(_levels_of_n5([1, 1, 1], [2, 2, 1]), _levels_of_n5([1, 1, 1], [4, 4, 1]),
                                      {"level": 1}),
        "resolution": Sample(_n5(), _n5(resolution=[2, 2, 3])),
        "voxel_offset": Sample(_precomputed(), _precomputed(voxel_offset=[1, 2, 3])),
    }
}  # fmt: skip
