"""Samples of formats whose headers are text: NRRD and MetaImage; and of NIfTI."""

from __future__ import annotations

from pathlib import Path

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

_TURNED = _PLAIN + "TransformMatrix = 0 1 0 1 0 0 0 0 1\n"
_SHORTS = _PLAIN + "DimSize = 2 3 2\nElementType = MET_USHORT\n"
_LISTS = "NDims = 4\nDimSize = 2 3 2 2\nElementSpacing = 1 1 1 1\n"

SAMPLES: Samples = {
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
        "thicknesses": Sample(_nrrd("thicknesses: nan nan nan\n"), _nrrd("thicknesses: nan nan 4\n")),
        "labels": Sample(_nrrd('labels: "x" "y" "z"\n'), _nrrd('labels: "z" "y" "x"\n')),
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
