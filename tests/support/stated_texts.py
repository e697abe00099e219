"""Samples of formats whose headers are text: NRRD and MetaImage; and of NIfTI."""

from __future__ import annotations

from pathlib import Path

from statement_samples import Sample, Samples, Writer

_METAIMAGE = "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementType = MET_UCHAR\n{}ElementDataFile = LOCAL\n"


def _metaimage(lines: str) -> Writer:
    def write(folder: Path) -> Path:
        path = folder / "a.mha"
        path.write_bytes(_METAIMAGE.format(lines).encode() + bytes(range(24)))
        return path

    return write


_PLAIN = "ElementSpacing = 1 1 1\n"

SAMPLES: Samples = {
    "MetaImage": {
        "ElementSpacing": Sample(_metaimage(_PLAIN), _metaimage("ElementSpacing = 1 1 2\n")),
        "Offset": Sample(_metaimage(_PLAIN), _metaimage(_PLAIN + "Offset = 5 0 0\n")),
        "TransformMatrix": Sample(_metaimage(_PLAIN), _metaimage(_PLAIN + "TransformMatrix = 0 1 0 1 0 0 0 0 1\n")),
        "DistanceUnits": Sample(_metaimage(_PLAIN), _metaimage(_PLAIN + "DistanceUnits = mm\n")),
    }
}
