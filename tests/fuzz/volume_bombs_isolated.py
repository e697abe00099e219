"""Small files that ask for much work or memory of the libraries that read TIFF, DICOM and VTK; and all such files."""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import pairwise

import imagecodecs
import numpy as np
import volume_bombs
from dicom_files import dicom_bytes, image_fields
from pydicom.uid import DeflatedExplicitVRLittleEndian, JPEG2000Lossless
from tiff_files import (
    BITS,
    BYTE,
    COMPRESSION,
    HEIGHT,
    LONG,
    SAMPLES,
    SHORT,
    STRIP_BYTES,
    STRIPS,
    WIDTH,
    described,
    directory,
    tiff,
)  # fmt: skip
from volume_bombs import ZLIB, Files, nested_sequences, stored_block, zeros_by_deflate
from volume_bombs_scientific import SCIENTIFIC


def _strip(compressed: bytes, compression: int, side: int = 4) -> Files:
    """Return a page of bytes with one compressed strip behind its directory."""
    fields = {
        WIDTH: (LONG, 1, side), HEIGHT: (LONG, 1, side), COMPRESSION: (SHORT, 1, compression), STRIPS: (LONG, 1, 300),
        STRIP_BYTES: (LONG, 1, len(compressed)),
    }  # fmt: skip
    return {"a.tif": tiff(fields).ljust(300, b"\0") + compressed}


def tiff_jpeg2000_of_other_sizes() -> Files:
    data = bytearray(imagecodecs.jpeg2k_encode(np.zeros((16, 16), np.uint8), codecformat="j2k"))
    place = data.index(b"\xff\x51") + 6
    data[place : place + 8] = struct.pack(">II", 2**31 - 1, 2**31 - 1)
    return _strip(bytes(data), 34712)


def tiff_directories_in_a_ring() -> Files:
    first = tiff({})
    return {"a.tif": tiff({}, following=len(first)) + directory({WIDTH: (SHORT, 1, 4)}, 24)}


def tiff_many_directories() -> Files:
    first = tiff({})
    page = len(directory({WIDTH: (SHORT, 1, 4)}))
    pages = [directory({WIDTH: (SHORT, 1, 4)}, len(first) + (k + 1) * page) for k in range(60_000)]
    return {"a.tif": tiff({}, following=len(first)) + b"".join(pages)}


def tiff_many_strips() -> Files:
    fields = {STRIPS: (LONG, 2**28, 300), STRIP_BYTES: (LONG, 2**28, 300), HEIGHT: (LONG, 1, 2**28), 278: (LONG, 1, 1)}
    return {"a.tif": (tiff(fields), 2**31)}


def _entities() -> str:
    """Return entities of XML, each of which is ten of the one before: `j` is a gigabyte."""
    more = (f'<!ENTITY {after} "{f"&{name};" * 10}">' for name, after in pairwise("abcdefghij"))
    return '<!ENTITY a "0">' + "".join(more)


def tiff_entities() -> Files:
    pixels = '<OME><Pixels SizeX="&j;" SizeZ="&j;" DimensionOrder="XYZCT"/></OME>'
    return {"a.tif": described(f'<?xml version="1.0"?><!DOCTYPE OME [{_entities()}]>{pixels}')}


def tiff_planes_of_ome() -> Files:
    data = '<TiffData IFD="0" PlaneCount="2147483647" FirstZ="2147483647"/>' * 20_000
    text = f'<OME><Pixels DimensionOrder="XYZCT" SizeX="4" SizeZ="1" SizeT="1" SizeC="1">{data}</Pixels></OME>'
    return {"a.tif": described(text)}


_PLANE = np.arange(16, dtype=np.uint16).reshape(4, 4)


def _in_dicom(fields: bytes, before: bytes = b"\x08\x00\x60\x00") -> bytes:
    """Return a file with more fields in it, before the one with this number."""
    data = dicom_bytes(image_fields(_PLANE))
    place = data.index(before, 132)
    return data[:place] + fields + data[place:]


def dicom_deflate_inflates() -> Files:
    data = dicom_bytes(image_fields(_PLANE), DeflatedExplicitVRLittleEndian)
    begin = 144 + struct.unpack_from("<I", data, 140)[0]
    return {"a.dcm": data[:begin] + zeros_by_deflate(4096)}


def dicom_deflate_inflates_into_a_field() -> Files:
    data = dicom_bytes(image_fields(_PLANE), DeflatedExplicitVRLittleEndian)
    begin = 144 + struct.unpack_from("<I", data, 140)[0]
    field = b"\x08\x00\x08\x00OB\0\0" + struct.pack("<I", 2**32 - 2)
    return {"a.dcm": data[:begin] + stored_block(field) + zeros_by_deflate(4096)}


def dicom_huge_jpeg2000() -> Files:
    stream = bytearray(imagecodecs.jpeg2k_encode(np.zeros((16, 16), np.uint16), codecformat="j2k"))
    place = stream.index(b"\xff\x51") + 6
    stream[place : place + 8] = struct.pack(">II", 65535, 65535)
    fields = image_fields(_PLANE, Rows=65535, Columns=65535)
    item = b"\xfe\xff\x00\xe0\0\0\0\0\xfe\xff\x00\xe0" + struct.pack("<I", len(stream)) + stream
    fields.PixelData = item + b"\xfe\xff\xdd\xe0\0\0\0\0"
    fields["PixelData"].is_undefined_length = True
    return {"a.dcm": dicom_bytes(fields, JPEG2000Lossless)}


def dicom_offsets_of_frames() -> Files:
    fields = image_fields(_PLANE, NumberOfFrames="30000", GridFrameOffsetVector=["1"] * 30_000)
    return {"a.dcm": dicom_bytes(fields)}


_VTI = (
    '<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="{header}"{compressor}>'
    '<ImageData WholeExtent="{extent}" Origin="0 0 0" Spacing="1 1 1"><Piece Extent="{extent}"><PointData Scalars="a">'
    '<DataArray type="UInt8" Name="a" format="appended" offset="0" NumberOfComponents="{components}"/></PointData>'
    '</Piece></ImageData><AppendedData encoding="raw">_'
)


def _vti(
    data: bytes, *, extent: str = "0 3 0 3 0 3", header: str = "UInt32", components: int = 1, compressed: bool = True
) -> Files:
    compressor = ' compressor="vtkZLibDataCompressor"' if compressed else ""
    text = _VTI.format(extent=extent, header=header, components=components, compressor=compressor)
    return {"a.vti": text.encode() + data + b"</AppendedData></VTKFile>"}


def vtk_blocks_inflate() -> Files:
    stream = ZLIB + zeros_by_deflate(4096)
    return _vti(struct.pack("<4I", 1, 2**31, 64, len(stream)) + stream)


def _pvti(pieces: str, extent: str = "0 3 0 3 0 3") -> Files:
    text = f'<VTKFile type="PImageData"><PImageData WholeExtent="{extent}">{pieces}</PImageData></VTKFile>'
    return {"a.pvti": text.encode(), **_vti(struct.pack("<I", 64) + bytes(64), compressed=False)}


def vtk_entities() -> Files:
    image = '<VTKFile type="ImageData"><a b="&j;">&j;</a></VTKFile>'
    return {"a.vti": f'<?xml version="1.0"?><!DOCTYPE VTKFile [{_entities()}]>{image}'.encode()}


def vtk_entity_of_a_file() -> Files:
    start = b'<?xml version="1.0"?><!DOCTYPE VTKFile [<!ENTITY a SYSTEM "file:///dev/zero">]>'
    return {"a.vti": start + b'<VTKFile type="ImageData"><ImageData>&a;</ImageData></VTKFile>'}


def vtk_attributes() -> Files:
    many = " ".join(f'a{k}="{k}"' for k in range(100_000))
    return {"a.vti": f'<VTKFile type="ImageData" {many}></VTKFile>'.encode()}


def _legacy(lines: str, data: bytes = bytes(64), *, sizes: str = "4 4 4") -> Files:
    start = "# vtk DataFile Version 3.0\na title\nBINARY\nDATASET STRUCTURED_POINTS\n"
    start += f"DIMENSIONS {sizes}\nSPACING 1 1 1\nORIGIN 0 0 0\n"
    return {"a.vtk": start.encode() + lines.encode() + data}


def vtk_legacy_other_grids() -> Files:
    lines = "DATASET UNSTRUCTURED_GRID\nPOINTS 999999999 double\nCELLS 999999999 999999999\n"
    return {"a.vtk": b"# vtk DataFile Version 3.0\na\nBINARY\n" + lines.encode() + bytes(64)}


ISOLATED: dict[str, dict[str, Callable[[], Files]]] = {
    "tiff": {
        "deflate_inflates": lambda: _strip(ZLIB + zeros_by_deflate(4096), 8),
        "deflate_claims_gigabytes": lambda: _strip(ZLIB + zeros_by_deflate(64), 8, side=60_000),
        "zstd_inflates": lambda: _strip(imagecodecs.zstd_encode(bytes(2**28)) * 16, 50000),
        "lzw_claims_gigabytes": lambda: _strip(imagecodecs.lzw_encode(bytes(2**16)), 5, side=60_000),
        "jpeg2000_of_other_sizes": tiff_jpeg2000_of_other_sizes,
        "directory_of_itself": lambda: {"a.tif": tiff({}, following=24)},
        "directories_in_a_ring": tiff_directories_in_a_ring,
        "many_directories": tiff_many_directories,
        "values_of_gigabytes": lambda: {"a.tif": (tiff({BITS: (SHORT, 2**31 - 1, 8), 700: (BYTE, 2**31, 8)}), 2**33)},
        "many_strips": tiff_many_strips,
        "many_samples": lambda: {"a.tif": tiff({SAMPLES: (SHORT, 1, 65535), WIDTH: (LONG, 1, 2**31),
            HEIGHT: (LONG, 1, 2**31)})},
        "entities": tiff_entities,
        "planes_of_ome": tiff_planes_of_ome,
        "images_of_imagej": lambda: {
            "a.tif": described(
                "ImageJ=1.53\nimages=999999999\nslices=2147483647\nframes=2147483647\nchannels=2147483647\n"
            )
        },
        "brackets_of_ome": lambda: {"a.tif": described("<OME>" + "<Pixels " * 300_000 + "<a:" * 300_000)},
        "blanks_of_ome": lambda: {"a.tif": described("<OME><Pixels " + ("SizeZ" + " " * 1000) * 2000 + "/></OME>")},
        "slices_of_many_names": lambda: {f"many/s{k * k}.tif": tiff({}) for k in range(400)},
    },
    "dicom": {
        "nested_sequences": lambda: {"a.dcm": _in_dicom(nested_sequences(50_000))},
        "open_sequences": lambda: {"a.dcm": _in_dicom(nested_sequences(300)[: 300 * 20])},
        "deflate_inflates": dicom_deflate_inflates,
        "deflate_inflates_into_a_field": dicom_deflate_inflates_into_a_field,
        "many_frames": lambda: {"a.dcm": dicom_bytes(image_fields(_PLANE, NumberOfFrames="2147483647",
            SpacingBetweenSlices="1"))},
        "millions_of_frames": lambda: {"a.dcm": dicom_bytes(image_fields(_PLANE, NumberOfFrames="9999999",
            SpacingBetweenSlices="1"))},
        "huge_plane": lambda: {"a.dcm": dicom_bytes(image_fields(_PLANE, Rows=65535, Columns=65535,
            SamplesPerPixel=65535))},
        "huge_jpeg2000": dicom_huge_jpeg2000,
        "field_of_gigabytes": lambda: {"a.dcm": (_in_dicom(b"\x08\x00\x08\x00OB\0\0" + struct.pack("<I", 2**32 - 2)),
            2**33)},
        "offsets_of_frames": dicom_offsets_of_frames,
        "many_series": lambda: {f"many/{k}.dcm": dicom_bytes(image_fields(_PLANE, uid=f"1.2.{k}",
            SeriesDescription="a long description of it " * 2)) for k in range(60)},
    },
    "vtk": {
        "blocks_inflate": vtk_blocks_inflate,
        "many_blocks": lambda: _vti(struct.pack("<4I", 2**32 - 1, 1, 1, 1)),
        "blocks_beyond_memory": lambda: _vti(struct.pack("<4Q", 2**61, 2**61, 1, 1), header="UInt64"),
        "blocks_of_no_bytes": lambda: _vti(struct.pack("<3I", 2**27, 0, 0) + bytes(2**20)),
        "huge_extent": lambda: _vti(struct.pack("<4I", 1, 64, 64, 64) + bytes(64),
            extent="0 2147483646 0 2147483646 0 2147483646"),
        "negative_extent": lambda: _vti(struct.pack("<I", 64) + bytes(64), extent="0 -3 0 -3 0 3", compressed=False),
        "many_components": lambda: _vti(struct.pack("<I", 64) + bytes(64), components=2**31 - 1, compressed=False),
        "length_lies": lambda: _vti(struct.pack("<I", 2**32 - 1) + bytes(64), compressed=False),
        "nested_elements": lambda: {"a.vti": b'<VTKFile type="ImageData">' + b"<a>" * 200_000},
        "many_pieces": lambda: _pvti('<Piece Extent="0 3 0 3 0 3" Source="a.vti"/>' * 9_000),
        "pieces_of_itself": lambda: _pvti('<Piece Extent="0 3 0 3 0 3" Source="a.pvti"/>'),
        "pieces_of_a_huge_image": lambda: _pvti('<Piece Extent="0 3 0 3 0 3" Source="a.vti"/>',
            "0 99999999 0 99999999 0 99999999"),
        "pieces_in_a_huge_extent": lambda: _pvti('<Piece Extent="0 99999 0 99999 0 9999" Source="a.vti"/>'),
        "entities": vtk_entities,
        "entity_of_a_file": vtk_entity_of_a_file,
        "attributes": vtk_attributes,
        "legacy_huge_sizes": lambda: _legacy("POINT_DATA 999999999999\nSCALARS a char\nLOOKUP_TABLE default\n",
            sizes="9999 9999 9999"),
        "legacy_long_type": lambda: _legacy(f"POINT_DATA 64\nSCALARS a {'x' * 5000}\nLOOKUP_TABLE default\n"),
        "legacy_long_name": lambda: _legacy(f"POINT_DATA 64\nSCALARS {'x' * 5000} char\nLOOKUP_TABLE default\n"),
        "legacy_many_components": lambda: _legacy("POINT_DATA 64\nSCALARS a char 999999999\nLOOKUP_TABLE default\n"),
        "legacy_many_fields": lambda: _legacy("POINT_DATA 64\nFIELD f 2147483647\na 1 64 char\n"),
        "legacy_huge_field": lambda: _legacy("POINT_DATA 64\nFIELD f 1\na 999999 999999 double\n"),
        "legacy_huge_table": lambda: _legacy(
            "POINT_DATA 64\nSCALARS a char\nLOOKUP_TABLE b\n" + "LOOKUP_TABLE b 2147483647\n", bytes(64)
        ),
        "legacy_metadata_without_end": lambda: _legacy("METADATA\nINFORMATION 999999999\nNAME a LOCATION b\n"),
        "legacy_long_title": lambda: {"a.vtk": b"# vtk DataFile Version 3.0\n" + b"x" * 2**22},
        "legacy_other_grids": vtk_legacy_other_grids,
    },
}  # fmt: skip
# By format and name.
BOMBS = volume_bombs.BOMBS | ISOLATED | SCIENTIFIC
