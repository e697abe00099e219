"""Samples of TIFF files: fields of a page, and descriptions of ImageJ and OME."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from statement_samples import Sample, Samples, Writer

from renderer.volume import Array

VALUES: Array = np.arange(48, dtype=np.uint8).reshape(2, 4, 6)
_SCALE = (0.5, 0.5, 2.0)
# Of a microscope, in the form that most of them have.
_RECORD = "[Scan]\r\nPixelWidth=1e-08\r\nPixelHeight=1e-08\r\n"


def _tiff(values: Array = VALUES, **options: Any) -> Writer:
    """Return a writer of a stack with a page for each plane."""
    kind = {"photometric": "minisblack", "metadata": None} | options

    def write(folder: Path) -> Path:
        tifffile.imwrite(folder / "a.tif", values, **kind)
        return folder / "a.tif"

    return write


def _field(number: int, kind: str, count: int, value: Any, **options: Any) -> Sample:
    """Return a sample of a page without and with a field."""
    return Sample(_tiff(**options), _tiff(extratags=[(number, kind, count, value, True)], **options))


def _record(number: int) -> Sample:
    return _field(number, "s", len(_RECORD) + 1, _RECORD)


def imagej(*lines: str, values: Array = VALUES, **tables: Any) -> Writer:
    """Return a writer of a file as ImageJ describes it. tables: its binary fields."""
    text = "\n".join(["ImageJ=1.54f", f"images={len(values)}", *lines, ""])
    more = [(code, kind, None if count is None else count, value, True)
            for code, kind, count, value in _binary(tables)]  # fmt: skip

    def write(folder: Path) -> Path:
        with tifffile.TiffWriter(folder / "a.tif", byteorder=">") as file:
            for k, plane in enumerate(values):
                own = {"description": text, "extratags": more} if k == 0 else {}
                file.write(plane, photometric="minisblack", metadata=None, resolution=(1, 1), resolutionunit=1, **own)
        return folder / "a.tif"

    return write


def _binary(tables: dict[str, Any]) -> list[tuple[int, str, int | None, Any]]:
    found = tifffile.tifffile.imagej_metadata_tag(tables, ">")
    return [(code, kind, count, value) for code, kind, count, value, _ in found]


_MICRON = ("slices=2", "unit=micron")
_CHANNELS = ("channels=2", "hyperstack=true")
_RAMP = np.tile(np.arange(256, dtype=np.uint8), (3, 1))

_IMAGEJ = {
    "slices": Sample(imagej("slices=2"), imagej("channels=2", "slices=1")),
    "unit": Sample(imagej("slices=2"), imagej(*_MICRON)),
    "spacing": Sample(imagej(*_MICRON), imagej(*_MICRON, "spacing=2.0")),
    "xorigin": Sample(imagej(*_MICRON), imagej(*_MICRON, "xorigin=3.0")),
    "finterval": Sample(imagej("frames=2", "slices=1"), imagej("frames=2", "slices=1", "finterval=2.0")),
    "c0": Sample(imagej(*_MICRON), imagej(*_MICRON, "cf=0", "c0=-10.0", "c1=2.0")),
    "cf": Sample(imagej(*_MICRON), imagej(*_MICRON, "cf=4", "c0=1.0", "c1=2.0")),
    "vunit": Sample(
        imagej(*_MICRON, "cf=0", "c0=-10.0", "c1=2.0"), imagej(*_MICRON, "cf=0", "c0=-10.0", "c1=2.0", "vunit=HU")
    ),
    "Ranges": Sample(imagej(*_CHANNELS), imagej(*_CHANNELS, Ranges=(0.0, 10.0, 0.0, 20.0))),
    "LUTs": Sample(imagej(*_CHANNELS), imagej(*_CHANNELS, LUTs=[_RAMP * np.array([[1], [0], [0]], np.uint8), _RAMP])),
    "Labels": Sample(imagej(*_CHANNELS), imagej(*_CHANNELS, Labels=["a", "b"])),
}


def ome(attributes: str = "", inside: str = "", count: str = "SizeZ='2'", after: str = "") -> Writer:
    """Return a writer of a file as OME describes it: attributes of its pixels, what is inside of them and behind."""
    text = (
        f"<OME><Image><Pixels SizeX='6' SizeY='4' {count} {attributes}>{inside}</Pixels></Image>{after}</OME>"
    )  # fmt: skip
    return _tiff(description=text)


_TWO = "SizeC='2'"
_CHANNEL = "<Channel/><Channel{}/>"
_PLANE = "<Plane TheT='{0}' DeltaT='{0}'/>"

_OME = {
    "PhysicalSizeX": Sample(ome(), ome("PhysicalSizeX='2'")),
    "DimensionOrder": Sample(
        _tiff(np.stack([VALUES, VALUES + 1]).reshape(4, 4, 6),
              description="<OME><Pixels SizeZ='2' SizeC='2' DimensionOrder='XYZCT'/></OME>"),
        _tiff(np.stack([VALUES, VALUES + 1]).reshape(4, 4, 6),
              description="<OME><Pixels SizeZ='2' SizeC='2' DimensionOrder='XYCZT'/></OME>"),
    ),
    "SizeC": Sample(ome(), ome(count=_TWO)),
    "TiffData": Sample(ome(), ome(inside="<TiffData IFD='1' FirstZ='0'/><TiffData IFD='0' FirstZ='1'/>")),
    "TimeIncrement": Sample(ome(count="SizeT='2'"), ome("TimeIncrement='2'", count="SizeT='2'")),
    "DeltaT": Sample(ome(count="SizeT='2'"), ome(inside=_PLANE.format(0) + _PLANE.format(1), count="SizeT='2'")),
    "Name": Sample(ome(inside=_CHANNEL.format(""), count=_TWO), ome(inside=_CHANNEL.format(" Name='a'"), count=_TWO)),
    "Color": Sample(
        ome(inside=_CHANNEL.format(""), count=_TWO), ome(inside=_CHANNEL.format(" Color='-16776961'"), count=_TWO)
    ),
    "PositionX": Sample(ome(inside="<Plane PositionX='0'/>"), ome(inside="<Plane PositionX='7'/>")),
    **{
        f"ModuloAlong{axis}": Sample(ome(), ome(after=f"<ModuloAlong{axis} Type='lifetime'/>")) for axis in "ZCT"
    },
}  # fmt: skip

_RGBA = np.stack([VALUES] * 4, -1)
_HALF = ((2, 2), (2, 2))
_GDAL = '<GDALMetadata><Item name="SCALE" sample="0" role="scale">0.1</Item></GDALMetadata>'

_TIFF = {
    "SampleFormat": Sample(_tiff(VALUES + 100), _tiff((VALUES + 100).astype(np.int8))),
    "Orientation": _field(274, "H", 1, 4),
    "XResolution": Sample(_tiff(), _tiff(resolution=(5, 5), resolutionunit=3)),
    "ResolutionUnit": Sample(_tiff(resolution=(5, 5), resolutionunit=3), _tiff(resolution=(10, 10),
                                                                                 resolutionunit=2)),
    "ModelPixelScaleTag": _field(33550, "d", 3, _SCALE),
    "GDAL_NODATA": _field(42113, "s", 2, "5"),
    "ExtraSamples": Sample(
        _tiff(_RGBA, photometric="rgb", extrasamples=["unspecified"]),
        _tiff(_RGBA, photometric="rgb", extrasamples=["unassalpha"]),
    ),
    "PhotometricInterpretation": Sample(_tiff(), _tiff(photometric="miniswhite")),
    "ColorMap": Sample(_tiff(), _tiff(photometric="palette", colormap=np.zeros((3, 256), np.uint16))),
    "AssociatedAlpha": Sample(
        _tiff(_RGBA, photometric="rgb", extrasamples=["unassalpha"]),
        _tiff(_RGBA, photometric="rgb", extrasamples=["assocalpha"]),
    ),
    "GrayResponseCurve": _field(291, "H", 256, (5,) * 256),
    "XPosition": _field(286, "2I", 1, (7, 1)),
    "ModelTiepointTag": _field(33922, "d", 6, (0.0, 0.0, 0.0, 5.0, 6.0, 0.0)),
    "ModelTransformationTag": _field(34264, "d", 16, tuple(range(16))),
    "GDAL_METADATA": _field(42112, "s", len(_GDAL) + 1, _GDAL),
    "CZ_SEM": _record(34118),
    "FEI_SFEG": _record(34680),
    "FEI_HELIOS": _record(34682),
    "OlympusSIS": _record(33560),
    "MicroManagerMetadata": _record(51123),
    "UIC1tag": _record(33628),
    "TVIPS": _record(37706),
}  # fmt: skip

SAMPLES: Samples = {"TIFF": _TIFF, "TIFF of ImageJ": _IMAGEJ, "OME-TIFF": _OME}
