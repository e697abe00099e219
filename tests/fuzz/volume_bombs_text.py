"""A megabyte of each kind of text in each place where a format has text: the time of readers must go with its length.

Patterns that backtrack take hours for these, and so do conversions of numbers of very many digits.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial

from tiff_files import ASCII, DESCRIPTION, tiff
from volume_bombs import META, NRRD, Files

NUM_BYTES = 2**20

# Kinds of text, by name: what is written again and again.
KINDS = {
    "blanks": b" ",
    "tabs_and_blanks": b" \t",
    "empty_lines": b"\n",
    "lines_of_blanks": b" \n",
    "digits": b"1",
    "digits_and_points": b"1.",
    "exponents": b"1e",
    "minus_signs": b"-",
    "commas": b",",
    "letters": b"a",
    "quotes": b'"',
    "open_quotes": b'a="',
    "other_quotes": b"a='",
    "brackets": b"(",
    "braces": b"{",
    "square_brackets": b"[",
    "open_elements": b"<",
    "elements": b"<a ",
    "ends_of_elements": b"</",
    "references": b"&#1",
    "digits_of_a_reference": b"1",
    "equal_signs": b"=",
    "colons": b":",
    "percent_signs": b"%",
    "escapes": b"\\u",
    "zeros": b"\0",
    "bytes_beyond_ascii": b"\xff",
}


def text_of(kind: str) -> bytes:
    """Return a megabyte of a kind of text."""
    unit = KINDS[kind]
    begin = b"&#" if kind == "digits_of_a_reference" else b""
    return (begin + unit * (NUM_BYTES // len(unit)))[:NUM_BYTES]


def _nrrd(line: str, kind: str) -> Files:
    header = NRRD.format(sizes="4 4 4", encoding="raw", more=line + "@\n").encode()
    return {"a.nrrd": header.replace(b"@", text_of(kind) + b".") + bytes(64)}


def _metaimage(line: str, kind: str) -> Files:
    header = META.format(sizes="4 4 4", more=line + "@\n").encode()
    return {"a.mha": header.replace(b"@", text_of(kind) + b".") + bytes(64)}


def _cube(kind: str) -> Files:
    return {"a.cube": b"a\nb\n1 0 0 0\n4 1 0 0\n4 0 1 0\n4 0 0 1\n1 1 0 0 0\n" + text_of(kind) + b"."}


def _nifti(begin: bytes, kind: str) -> Files:
    """Return a file of labels with an extension."""
    text = begin + text_of(kind) + b".\n2 b\n"
    extension = struct.pack("<ii", len(text) + 8, 6) + text
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, 4, 4, 4, 1, 1, 1, 1)
    struct.pack_into("<3h", header, 68, 1002, 2, 8)
    struct.pack_into("<8f", header, 76, *[1.0] * 8)
    struct.pack_into("<f", header, 108, 352 + len(extension))
    header[344:349] = b"n+1\0\1"
    return {"a.nii": bytes(header) + extension + bytes(64)}


_VTI = b'<VTKFile type="ImageData" @><ImageData WholeExtent="0 3 0 3 0 3"></ImageData></VTKFile>'
_PVTI = b'<VTKFile type="PImageData"><PImageData WholeExtent="0 3 0 3 0 3" @><Piece Extent="0 3" Source="a"/>'
_LEGACY = b"# vtk DataFile Version 3.0\n@\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 4 4 4\n"
_APPENDED = b'<VTKFile type="ImageData"><AppendedData encoding="raw" @ encoding="raw">_</AppendedData></VTKFile>'


def _vtk(name: str, template: bytes, kind: str) -> Files:
    return {name: template.replace(b"@", text_of(kind))}


_OME = b'<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/"><Pixels SizeX="4" @></Pixels></OME>'
_IMAGEJ = b"ImageJ=1.53\nimages=2\nslices=2\n@\nspacing=1@\n"
_SHAPED = b'{"shape": [2, 4, 4], "axes": "@"}'


def _tiff(template: bytes, kind: str) -> Files:
    text = template.replace(b"@", text_of(kind).replace(b"\0", b"0"))
    return {"a.tif": tiff({DESCRIPTION: (ASCII, len(text) + 1, 24)}, text + b"\0")}


def _in_each_kind(make: Callable[[str], Files], place: str) -> dict[str, Callable[[], Files]]:
    return {f"{kind}_in_{place}": partial(make, kind) for kind in KINDS}


# By format and name.
TEXTS: dict[str, dict[str, Callable[[], Files]]] = {
    "nrrd": {
        **_in_each_kind(partial(_nrrd, "spacings: 1 1 "), "a_number"),
        **_in_each_kind(partial(_nrrd, "space directions: (1,0,0) ("), "a_vector"),
        **_in_each_kind(partial(_nrrd, 'units: "mm" "'), "a_unit"),
        **_in_each_kind(partial(_nrrd, "kinds: domain "), "a_kind"),
        **_in_each_kind(partial(_nrrd, "data file: "), "a_file"),
        **_in_each_kind(partial(_nrrd, "Segment0_Name:="), "a_name"),
        **_in_each_kind(partial(_nrrd, "Segment0_LabelValue:="), "a_label"),
        **_in_each_kind(partial(_nrrd, ""), "a_line"),
    },
    "metaimage": {
        **_in_each_kind(partial(_metaimage, "ElementSpacing = 1 1 "), "a_number"),
        **_in_each_kind(partial(_metaimage, "ElementDataFile = "), "a_file"),
        **_in_each_kind(partial(_metaimage, "Kinds = "), "a_kind"),
        **_in_each_kind(partial(_metaimage, ""), "a_line"),
    },
    "cube": _in_each_kind(_cube, "a_value"),
    "nifti": {
        **_in_each_kind(partial(_nifti, b"1 a"), "a_name"),
        **_in_each_kind(partial(_nifti, b""), "a_row"),
        **_in_each_kind(partial(_nifti, b'1 1 2 3 1 1 0 "'), "a_row_of_itk_snap"),
        **_in_each_kind(partial(_nifti, b'<LabelTable><Label Key="1">'), "a_table_of_xml"),
        **_in_each_kind(partial(_nifti, b'atr_name="VALUE_LABEL_DTABLE" > "'), "a_table_of_afni"),
    },
    "vtk": {
        **_in_each_kind(partial(_vtk, "a.vti", _VTI), "an_element"),
        **_in_each_kind(partial(_vtk, "a.pvti", _PVTI), "a_parallel_element"),
        **_in_each_kind(partial(_vtk, "a.vtk", _LEGACY), "a_legacy_header"),
        **_in_each_kind(partial(_vtk, "a.vti", _APPENDED), "appended_data"),
    },
    "tiff": {
        **_in_each_kind(partial(_tiff, _OME), "an_element_of_ome"),
        **_in_each_kind(partial(_tiff, _IMAGEJ), "lines_of_imagej"),
        **_in_each_kind(partial(_tiff, _SHAPED), "json"),
    },
}
