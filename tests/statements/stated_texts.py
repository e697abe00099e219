"""Samples of formats whose headers are text: NRRD and MetaImage; and of NIfTI."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from statement_samples import Sample, Samples, Writer

_METAIMAGE = {
    "ObjectType": "Image",
    "NDims": "3",
    "DimSize": "2 3 4",
    "ElementType": "MET_UCHAR",
}


def _metaimage(lines: str) -> Writer:
    def write(folder: Path) -> Path:
        path = folder / "a.mha"
        own = dict(line.split(" = ") for line in lines.splitlines())
        fields = {**_METAIMAGE, **own, "ElementDataFile": "LOCAL"}
        header = "".join(f"{name} = {text}\n" for name, text in fields.items())
        path.write_bytes(header.encode() + bytes(range(24)))
        return path

    return write


_NRRD = "NRRD0005\ntype: {}\ndimension: {}\nsizes: {}\nencoding: raw\n{}\n"


def _nrrd(lines: str, sizes: str = "2 3 4", kind: str = "uint8") -> Writer:
    def write(folder: Path) -> Path:
        path = folder / "a.nrrd"
        path.write_bytes(_NRRD.format(kind, len(sizes.split()), sizes, lines).encode() + bytes(range(24)))
        return path

    return write


_ORIENTED = "space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
_FOUR = "4 2 3 1"
_DOMAINS = "kinds: list domain domain domain\n"
_SEGMENTS = "Segment0_Name:=a\nSegment0_LabelValue:=7\nSegment0_Layer:=0\n"

_PLAIN = "ElementSpacing = 1 1 1\n"

# Where fields of NIfTI and Analyze are, and their type.
_FIELDS = {
    "vox_units": (56, "4s"),
    "intent_p1": (56, "f"),
    "cal_units": (60, "8s"),
    "intent_code": (68, "h"),
    "pixdim[0]": (76, "f"),
    "pixdim[3]": (88, "f"),
    "pixdim[4]": (92, "f"),
    "scl_slope": (112, "f"),
    "scl_inter": (116, "f"),
    "xyzt_units": (123, "b"),
    "toffset": (136, "f"),
    "qform_code": (252, "h"),
    "orient": (252, "b"),
    "originator[0]": (253, "h"),
    "sform_code": (254, "h"),
    "quatern_b": (256, "f"),
    "srow_x[0]": (280, "f"),
    "srow_y[1]": (300, "f"),
    "srow_z[2]": (320, "f"),
    "intent_name": (328, "16s"),
}


def _header(sizes: tuple[int, ...], fields: dict[str, Any]) -> bytearray:
    header = bytearray(348)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, len(sizes), *sizes, *[1] * (7 - len(sizes)))
    struct.pack_into("<hh", header, 70, 2, 8)
    struct.pack_into("<8f", header, 76, *[1.0] * 8)
    for name, value in fields.items():
        place, kind = _FIELDS[name]
        struct.pack_into("<" + kind, header, place, value)
    return header


def _nifti(sizes: tuple[int, ...] = (2, 3, 4), table: bytes = b"", **fields: Any) -> Writer:
    """Return a writer of NIfTI. table: the text of an extension."""

    def write(folder: Path) -> Path:
        header = _header(sizes, fields)
        padded = table.ljust(-(-(len(table) + 8) // 16) * 16 - 8, b"\0")
        extension = struct.pack("<ii", len(padded) + 8, 6) + padded if table else b""
        struct.pack_into("<f", header, 108, 352 + len(extension))
        header[344:348] = b"n+1\0"
        path = folder / "a.nii"
        path.write_bytes(header + bytes([bool(table), 0, 0, 0]) + extension + bytes(range(24)))
        return path

    return write


def _analyze(**fields: Any) -> Writer:
    def write(folder: Path) -> Path:
        path = folder / "a.hdr"
        path.write_bytes(_header((2, 3, 4), fields))
        path.with_suffix(".img").write_bytes(bytes(range(24)))
        return path

    return write


_SFORM = {"srow_x[0]": 2.0, "srow_y[1]": 3.0, "srow_z[2]": 4.0}
_QFORM = {"qform_code": 1, "pixdim[0]": 1.0}
_IN_TIME = (2, 3, 2, 2)

_TURNED = _PLAIN + "TransformMatrix = 0 1 0 1 0 0 0 0 1\n"
_SHORTS = _PLAIN + "DimSize = 2 3 2\nElementType = MET_USHORT\n"
_LISTS = "NDims = 4\nDimSize = 2 3 2 2\nElementSpacing = 1 1 1 1\n"

SAMPLES: Samples = {
    "NIfTI and Analyze": {
        "sform_code": Sample(_nifti(**_SFORM), _nifti(sform_code=1, **_SFORM)),
        "qform_code": Sample(_nifti(quatern_b=0.6), _nifti(quatern_b=0.6, **_QFORM)),
        "qfac": Sample(_nifti(**_QFORM), _nifti(**_QFORM | {"pixdim[0]": -1.0})),
        "pixdim": Sample(_nifti(), _nifti(**{"pixdim[3]": 2.0})),
        "scl_slope": Sample(_nifti(scl_slope=1.0), _nifti(scl_slope=2.0)),
        "scl_inter": Sample(_nifti(scl_slope=1.0), _nifti(scl_slope=1.0, scl_inter=-1024.0)),
        "xyzt_units": Sample(_nifti(_IN_TIME), _nifti(_IN_TIME, xyzt_units=2 + 32)),
        "toffset": Sample(_nifti(_IN_TIME, xyzt_units=8), _nifti(_IN_TIME, xyzt_units=8, toffset=3.0)),
        "intent_code": Sample(_nifti(), _nifti(intent_code=5)),
        "intent_p1": Sample(_nifti(intent_code=3), _nifti(intent_code=3, intent_p1=12.0)),
        "intent_name": Sample(_nifti(), _nifti(intent_name=b"thickness")),
        "extensions": Sample(_nifti(intent_code=1002), _nifti(intent_code=1002, table=b"1 a\n2 b\n")),
        "funused1": Sample(_analyze(), _analyze(scl_slope=2.0)),
        "originator": Sample(_analyze(), _analyze(**{"originator[0]": 1})),
        "vox_units": Sample(_analyze(), _analyze(vox_units=b"um")),
        "cal_units": Sample(_analyze(), _analyze(cal_units=b"HU")),
        "orient": Sample(_analyze(), _analyze(orient=2)),
    },
    "NRRD": {
        "space": Sample(_nrrd(_ORIENTED), _nrrd(_ORIENTED.replace("left-posterior-superior", "3D-left-handed"))),
        "space directions": Sample(_nrrd(_ORIENTED), _nrrd(_ORIENTED.replace("(1,0,0)", "(2,0,0)"))),
        "space origin": Sample(_nrrd(_ORIENTED), _nrrd(_ORIENTED + "space origin: (5,0,0)\n")),
        "spacings": Sample(_nrrd(""), _nrrd("spacings: 1 1 2\n")),
        "axis mins": Sample(_nrrd("spacings: 1 1 1\n"), _nrrd("spacings: 1 1 1\naxis mins: 3 0 0\n")),
        "axis maxs": Sample(_nrrd("axis mins: 0 0 0\n"), _nrrd("axis mins: 0 0 0\naxis maxs: 4 3 4\n")),
        "centers": Sample(_nrrd("axis mins: 0 0 0\n"), _nrrd("axis mins: 0 0 0\ncenters: node node node\n")),
        "endian": Sample(
            _nrrd("endian: little\n", "2 3 2", "uint16"),
            _nrrd("endian: big\n", "2 3 2", "uint16"),
        ),
        "kinds": Sample(_nrrd(_DOMAINS, _FOUR), _nrrd(_DOMAINS.replace("list", "quaternion"), _FOUR)),
        "units": Sample(_nrrd("spacings: 1 1 1\n"), _nrrd('spacings: 1 1 1\nunits: "mm" "mm" "mm"\n')),
        "space units": Sample(_nrrd(_ORIENTED), _nrrd(_ORIENTED + 'space units: "mm" "mm" "mm"\n')),
        "sample units": Sample(_nrrd(""), _nrrd("sample units: K\n")),
        "Segment": Sample(_nrrd(""), _nrrd(_SEGMENTS)),
        "measurement frame": Sample(
            _nrrd(_ORIENTED + "measurement frame: (1,0,0) (0,1,0) (0,0,1)\n"),
            _nrrd(_ORIENTED + "measurement frame: (0,1,0) (1,0,0) (0,0,1)\n"),
        ),
        "old min": Sample(_nrrd(""), _nrrd("old min: 0.5\n")),
        "old max": Sample(_nrrd(""), _nrrd("old max: 0.5\n")),
    },
    "MetaImage": {
        "ElementSpacing": Sample(_metaimage(_PLAIN), _metaimage("ElementSpacing = 1 1 2\n")),
        "Offset": Sample(_metaimage(_PLAIN), _metaimage(_PLAIN + "Offset = 5 0 0\n")),
        "TransformMatrix": Sample(_metaimage(_PLAIN), _metaimage(_TURNED)),
        "DistanceUnits": Sample(_metaimage(_PLAIN), _metaimage(_PLAIN + "DistanceUnits = mm\n")),
        "AnatomicalOrientation": Sample(_metaimage(_PLAIN), _metaimage(_PLAIN + "AnatomicalOrientation = RAI\n")),
        "ElementByteOrderMSB": Sample(_metaimage(_SHORTS), _metaimage(_SHORTS + "ElementByteOrderMSB = True\n")),
        "ElementToIntensityFunctionSlope": Sample(
            _metaimage(_PLAIN + "ElementToIntensityFunctionSlope = 1\n"),
            _metaimage(_PLAIN + "ElementToIntensityFunctionSlope = 2\n"),
        ),
        "ElementToIntensityFunctionOffset": Sample(
            _metaimage(_PLAIN + "ElementToIntensityFunctionOffset = 0\n"),
            _metaimage(_PLAIN + "ElementToIntensityFunctionOffset = -1024\n"),
        ),
        "Kinds": Sample(
            _metaimage(_LISTS + "Kinds = domain domain domain list\n"),
            _metaimage(_LISTS + "Kinds = list domain domain domain\n"),
        ),
        "CenterOfRotation": Sample(_metaimage(_TURNED), _metaimage(_TURNED + "CenterOfRotation = 1 0 0\n")),
    },
}
