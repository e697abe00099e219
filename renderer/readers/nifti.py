"""Read NIfTI-1 and NIfTI-2, single files (.nii, .nii.gz) and pairs (.hdr with .img), and pairs of Analyze 7.5.

nibabel interprets the header, and gets no other bytes. The only extensions that are read are tables of labels, by
Caret, TotalSegmentator, AFNI and MRIcron. `stored.py` reads the voxels.

The affine is the sform if it is set and invertible, else the qform, else the voxel sizes alone, with the first voxel at
the origin. RAS becomes LPS by negating x and y. Axes after z are time (the fourth) and component (the fifth), as in the
standard. A pair without NIfTI's mark is Analyze 7.5, with the scale and the origin that SPM keeps there, if any.
"""

from __future__ import annotations

import gzip
import logging
import math
import re
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.looks import MAX_LOOK_BYTES, read_extension
from renderer.readers.affines import has_volume, in_lps
from renderer.readers.components import choose
from renderer.readers.data_files import named_file
from renderer.readers.file_errors import errors_about, labels_or_note, require_exists, unreadable_error
from renderer.readers.foreign import refuse_pointer
from renderer.readers.image import Image
from renderer.readers.scaled_values import scaled
from renderer.readers.sniff import read_start
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.steps_in_time import TimeSteps, even_steps_at
from renderer.readers.stored import Layout, StoredVoxels, check_deflated, read_stored
from renderer.readers.units import Units, units_of
from renderer.readers.voxel_limits import check_dtype, describe_shape
from renderer.scene import short_text
from renderer.volume import Float64, Label

# The length of a NIfTI-1 header in bytes, which is also the first number in the header.
_NIFTI_1_BYTES = 348
# The length of a NIfTI-2 header in bytes, which is also the first number in the header.
_NIFTI_2_BYTES = 540
# A pattern of the file names of a pair: one file with the header, and one with the voxels.
_PAIR = re.compile(r"(.*\.)(hdr|img)(\.gz)?", re.IGNORECASE | re.DOTALL)

# The bytes of the header in which NIfTI-1 has the beginning of its mark. Analyze has a number there, usually 0.
_MARK = slice(344, 346)
# The first letters of NIfTI's mark, in a single file and in a pair.
_MARKS = (b"n+", b"ni")

# The note on an Analyze file.
_ANALYZE = (
    "Analyze 7.5 does not say which side is left: x runs from right to left, y to the front and z up, as its "
    "standard says"
)

STATEMENTS = FormatTable(
    "NIfTI and Analyze",
    (
        Statement("sform_code", "place", "whether srow_x, srow_y and srow_z place the voxels"),
        Statement("qform_code", "place", "whether a quaternion places the voxels, without sform"),
        Statement("qfac", "place", "whether the third axis is turned over, in pixdim[0]"),
        Statement("pixdim", "place", "the sizes of voxels"),
        Statement("scl_slope", "values", "a factor of the values"),
        Statement("scl_inter", "values", "an offset of the values"),
        Statement("xyzt_units", "meaning", "the units of lengths and of the fourth axis"),
        Statement("toffset", "meaning", "the time of the first step"),
        Statement("intent_code", "meaning", "the kind of values: labels, a statistic, components of a vector"),
        Statement("intent_p1", "meaning", "a parameter of a statistic; so are intent_p2 and intent_p3"),
        Statement("intent_name", "meaning", "a name of the values"),
        Statement("extensions", "meaning", "names and colours of labels"),
        Statement("funused1", "values", "a factor of the values, of SPM in Analyze"),
        Statement("originator", "place", "the origin, of SPM in Analyze"),
        Statement("vox_units", "meaning", "the unit of lengths in Analyze"),
        Statement("cal_units", "meaning", "the unit of values in Analyze"),
        Statement("orient", "place", "the orientation of the slices of Analyze", is_applied=False),
    ),
)

# The kind of values that each code of the field `intent_code` stands for.
_INTENTS = {
    2: "correlations",
    3: "t statistics",
    4: "F statistics",
    5: "z scores",
    6: "chi-squared statistics",
    22: "p values",
    23: "logarithms of p values",
    24: "decimal logarithms of p values",
    1001: "estimates",
    1003: "names of brain regions",
    1004: "matrices",
    1005: "symmetric matrices",
    1006: "displacements",
    1007: "vectors",
    1008: "points",
    1009: "triangles",
    1010: "quaternions",
    1011: "values without a unit",
    2001: "time series",
    2003: "colours",
    2004: "colours",
    2005: "shapes",
}
# The codes of the field `intent_code` that need no note: those for no intent, and for labels.
_NO_INTENTS = (0, 1002)
# The names of the components of a voxel, by the code of the field `intent_code`.
_COMPONENTS = {
    1005: "xx yx yy zx zy zz",
    1006: "x y z",
    1007: "x y z",
    1010: "w x y z",
    2003: "R G B",
    2004: "R G B A",
}
# The units of the fourth axis that are not units of time, by their codes in the field `xyzt_units`.
_OTHER_UNITS = {32: "Hz", 40: "ppm", 48: "rad/s"}

# The code of the field `intent_code` for labels. If voxels are colours of four bytes, the file is a probabilistic atlas
# of the viewer niivue.
_LABEL = 1002
# The names of the four bytes of a voxel of a probabilistic atlas of niivue.
_ATLAS = ("label", "second label", "probability", "second probability")

# The largest distance, in voxels, between the places of a corner by the two affines, qform and sform, that count as the
# same place: the affines are rounded in different ways.
_SAME_PLACE = 0.1

# The units of lengths, by their codes in the field `xyzt_units`.
_LENGTH_UNITS = {1: "m", 2: "mm", 3: "µm"}
# The units of time of the fourth axis, by their codes in the field `xyzt_units`. An axis without a unit may be time.
_TIME_UNITS = {0: "", 8: "s", 16: "ms", 24: "us"}

# A logger that keeps nibabel's remarks on a header and its repairs off the terminal.
_SILENT = logging.Logger(__name__, logging.CRITICAL + 1)

# A header as nibabel has it: a Nifti1Header, of which NIfTI-2 has a subclass, or a Spm99AnalyzeHeader.
_Header = Any


def read_nifti(path: Path, time: int | None, component: int | None) -> Image:
    """Read the volume in a NIfTI file, scaled by the header's slope and intercept, if any.

    Scaled values are float32 if the stored ones have at most 16 bits or are float32, else float64. Raises InputError
    for truncated and foreign files, and if `time` or `component` do not fit.
    """
    header_file, data_file = find_pair(path)
    start, is_compressed = read_start(header_file, _NIFTI_2_BYTES + 4)
    with errors_about(header_file):
        if is_compressed and data_file is not None:  # a single file is checked as its voxels are read
            check_deflated(header_file, len(start))
        header, notes = _header(start, header_file, is_single=data_file is None)
    if data_file is not None:
        is_compressed = data_file.suffix.lower() == ".gz"
    shape = tuple(int(n) for n in header.get_data_shape())
    shape += (1,) * (5 - len(shape))
    dtype = header.get_data_dtype()
    fields = dtype.names  # RGB24 and RGBA32 are records of bytes
    if fields is None:
        check_dtype(dtype)
    if shape[5:].count(1) != len(shape[5:]):
        got, expected = describe_shape(shape), "x, y, z, then time and component"
        raise InputError("the volume has too many axes", got=got, expected=expected)
    offset = int(header["vox_offset"])
    part = StoredVoxels(data_file or header_file, 0, "deflate" if is_compressed else "raw", offset, has_rest=True)
    layout, names = Layout(dtype, shape[4::-1], (part,)), fields or ()
    if not _is_analyze(header):
        intent = int(header["intent_code"])
        names = _ATLAS if len(names) == 4 and intent == _LABEL else names or tuple(_COMPONENTS.get(intent, "").split())
    chosen = choose("ctsss", (len(names) or shape[4], *layout.shape[1:]), time, component, names)
    values, left_over = read_stored(layout, chosen._replace(part=(0, *chosen.part[1:])) if fields else chosen)
    values = values[fields[chosen.component]] if fields else values
    try:
        placed, axes = ras_from_index(header)
    except ValueError as error:  # the quaternion is not a rotation
        raise unreadable_error(error) from error
    slope, intercept = header.get_slope_inter()
    if slope is not None:
        values = scaled(values, slope, intercept or 0.0)
    notes += [*[_ANALYZE] * _is_analyze(header), left_over, *chosen.notes, *_statements(header)]
    has_extensions = data_file is None and start[len(header.binaryblock) :][:1] not in (b"", b"\0")
    labels, wrong = labels_or_note(lambda: _labels(header, part, time or 0) if has_extensions else ())
    world_from_index = in_lps(placed, (-1.0, -1.0, 1.0))
    all_notes, steps = (*notes, wrong), _steps(header, shape[3])
    if _is_analyze(header):
        length, value = (header[name].item().decode("latin-1") for name in ("vox_units", "cal_units"))
        units = units_of(length or "mm", "", value)
    else:
        units = Units(_LENGTH_UNITS.get(int(header["xyzt_units"]) & 0b111, ""), axes)
    return Image(values, world_from_index, all_notes, (), chosen.channels, labels, steps, units)


def _statements(header: _Header) -> Iterator[str | None]:
    """Yield notes on fields of the header that are not applied, or that a user should know."""
    found = {name for name in header.keys() if np.any(header[name])} & {each.field for each in STATEMENTS.statements}  # noqa: SIM118
    if _is_analyze(header):
        yield STATEMENTS.note(found)
        return
    intent = int(header["intent_code"])
    if intent not in _NO_INTENTS:
        parameters = [f"{number:g}" for k in (1, 2, 3) if (number := float(header[f"intent_p{k}"]))]
        words = _INTENTS.get(intent, "of a kind that is not known here")
        yield f"its values are {words} ({', '.join([f'intent_code {intent}', *parameters])})"
    if name := header["intent_name"].item().decode("latin-1").strip():
        yield f"its values are called {short_text(name)}"
    if unit := _OTHER_UNITS.get(int(header["xyzt_units"]) & 0b111000):
        yield f"its fourth axis is in {unit} and no time"
    if {"sform_code", "qform_code"} <= found and _places_differ(header):
        yield "its qform gives the voxels another place than its sform, which counts"


def _places_differ(header: _Header) -> bool:
    """Return whether the header has two affines that place a corner of the volume in different voxels."""
    sform, qform = header.get_sform(), header.get_qform()
    if not (has_volume(sform) and has_volume(qform)):
        return False
    corner = np.array([*header["dim"][1:4], 1.0])
    with np.errstate(over="ignore", invalid="ignore"):
        moved = np.abs(np.linalg.solve(sform, (qform - sform) @ np.stack([corner, [0.0, 0.0, 0.0, 1.0]], axis=1)))
    return bool(moved.max() > _SAME_PLACE)


def _steps(header: _Header, count: int) -> TimeSteps:
    """Return the steps in time. They have no times if the unit of the fourth axis is not one of time, such as Hz."""
    unit = None if _is_analyze(header) else _TIME_UNITS.get(int(header["xyzt_units"]) & 0b111000)
    if unit is None:
        return TimeSteps(count)
    step, first = (float(str(number)) for number in (header["pixdim"][4], header["toffset"]))  # 0.1, not 0.1000000015
    return even_steps_at(count, step, unit, first)


def _labels(header: _Header, voxels: StoredVoxels, time: int) -> tuple[Label, ...]:
    """Return the labels of an extension between the header and the voxels.

    The content of an extension shows its format, as codes vary. The bytes need not be an extension at all.
    """
    begin, content = len(header.binaryblock) + 4, b""
    read = gzip.open if voxels.encoding == "deflate" else open
    # Damage is reported when the voxels are read.
    with suppress(EOFError, OSError, zlib.error), read(voxels.file, "rb") as opened:
        opened.seek(begin)
        content = opened.read(min(voxels.num_skipped - begin, MAX_LOOK_BYTES))
    are_labels, labels, at = bool(header["intent_code"] == _LABEL), tuple[Label, ...](), 0
    while not labels and at + 8 <= len(content):  # an extension has its length, its code, and its content
        end = at + struct.unpack_from(header.endianness + "i", content, at)[0]
        if not at + 8 < end <= len(content):
            break
        labels, at = read_extension(voxels.file, content[at + 8 : end], time, are_labels=are_labels), end
    return labels


def find_pair(path: Path) -> tuple[Path, Path | None]:
    """Return the file of the header and, for a pair, the file of the voxels.

    Raises InputError if a file of a pair is missing.
    """
    pair = _PAIR.fullmatch(path.name)
    if pair is None:
        return path, None
    start, name, end = pair[1], pair[2], pair[3] or ""
    names = (start + (each.upper() if name.isupper() else each) + end for each in ("hdr", "img"))
    header, data = (named_file(path, each) for each in names)
    require_exists(header)
    if not data.is_file():
        raise InputError(
            "the data file that belongs to this header is not there", where=str(header), expected=f"a file {data}"
        )
    refuse_pointer(require_exists(data))
    return header, data


def _header(start: bytes, path: Path, *, is_single: bool) -> tuple[_Header, list[str | None]]:
    """Return the header at the beginning of a file, and notes on sizes of 0 that are taken for 1.

    Raises InputError if the bytes are not a header, or the header is wrong.
    """
    import nibabel

    nib: Any = nibabel
    classes = {
        _NIFTI_1_BYTES: (nib.nifti1.Nifti1PairHeader, nib.Nifti1Header),
        _NIFTI_2_BYTES: (nib.nifti2.Nifti2PairHeader, nib.Nifti2Header),
    }
    for order in "<>" if len(start) >= _NIFTI_1_BYTES else "":
        num_bytes = struct.unpack_from(order + "i", start)[0]
        if num_bytes in classes and len(start) >= num_bytes:
            is_analyze = num_bytes == _NIFTI_1_BYTES and not is_single and start[_MARK] not in _MARKS
            kind = nib.Spm99AnalyzeHeader if is_analyze else classes[num_bytes][is_single]
            header = kind(start[:num_bytes], order, check=False)
            _check_offset_and_slope(header, least=num_bytes + 4 if is_single else 0)
            if not 1 <= header["dim"][0] <= 7:
                break
            notes = _mend_sizes(header)
            try:
                header.check_fix(_SILENT)
                header.get_data_shape(), header.get_slope_inter()
            except nib.spatialimages.HeaderDataError:
                break
            return header, notes
    raise InputError(
        "this is not a NIfTI file, or it is damaged",
        expected="a header of NIfTI-1 or NIfTI-2, whose type of voxels and axes are known",
    )


def _mend_sizes(header: _Header) -> list[str | None]:
    """Replace sizes of 0 by 1, as the standard's own library does, and return notes on them.

    nibabel itself replaces voxel sizes of 0. An sform makes voxel sizes irrelevant, so that they need no note.
    """
    axes = range(1, int(header["dim"][0]) + 1)
    voxels = [k for k in axes if header["dim"][k] == 0 and k > 1]
    header["dim"][voxels] = 1
    has_sform = not _is_analyze(header) and header["sform_code"] > 0 and has_volume(header.get_sform())
    lengths = [k for k in axes if k < 4 and header["pixdim"][k] == 0 and not has_sform]
    found = (("number of voxels", voxels), ("voxel size", lengths))
    return [
        f"the file has a {what} of 0 along {', '.join('xyztuvw'[k - 1] for k in ks)}; 1 is assumed"
        for what, ks in found
        if ks
    ]


def _check_offset_and_slope(header: _Header, least: int) -> None:
    """Raise InputError if the offset of the voxels is inside the header or not finite, and for an infinite slope.

    A slope of 0 or NaN stands for no scale; nibabel would take an infinite slope for no scale, too.
    """
    offset, slope = header["vox_offset"].item(), header["scl_slope"].item()
    if not (math.isfinite(offset) and offset >= least):
        raise InputError(
            "the voxels of this NIfTI file cannot be where its header says",
            got=f"vox_offset = {offset:g}",
            expected=f"{least} or more" + ", behind the header" * (least > 0),
            hint="save it again, or correct the header",
        )
    if math.isinf(slope):
        raise InputError(
            "this NIfTI header scales its values by a number that is not finite",
            got=f"scl_slope = {slope:g}",
            expected="a finite number, or 0 for values as they are stored",
            hint="correct the header, or save the file again",
        )


def _is_analyze(header: _Header) -> bool:
    return "sform_code" not in header


def ras_from_index(header: _Header) -> tuple[Float64, str]:
    """Return the affine from voxel indices to RAS, float64 [4, 4], and `LPS` if it places the voxels in a body."""
    if _is_analyze(header):  # the world's origin is SPM's origin, or else the middle of the volume
        return np.array(header.get_origin_affine(), np.float64), ""
    for code, affine in (("sform_code", header.get_sform), ("qform_code", header.get_qform)):
        if header[code] > 0 and has_volume(affine()):
            return np.array(affine(), np.float64), "LPS"
    # Method 1 of the standard: x = pixdim[1] i and so on. nibabel, compatible with Analyze, would mirror it.
    sizes = np.ones(3)
    num_axes = min(3, int(header["dim"][0]))
    sizes[:num_axes] = header["pixdim"][1 : num_axes + 1]
    return np.diag([*sizes, 1.0]), ""
