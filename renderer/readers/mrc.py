"""Read MRC and CCP4 (.mrc, .map, .ccp4, .rec, also with gzip): a header of fixed length, and voxels behind it.

Format: https://www.ccpem.ac.uk/mrc_format/mrc2014.php. Lengths are in angstrom. Columns, rows and sections run along
the axes of the cell in any order, and these axes need not be perpendicular. `ORIGIN` is the place of the first voxel;
if it is 0, `NSTART` is this place.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import NO_SPACING, affine
from renderer.readers.components import choose
from renderer.readers.image import Image
from renderer.readers.sniff import MRC_MARK, read_start
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.stored import Layout, StoredVoxels, read_stored
from renderer.readers.units import Units
from renderer.volume import Array, Float64

# The length of an MRC header in bytes.
_NUM_HEADER_BYTES = 1024
_FIELDS = np.dtype([
    ("sizes", "3i4"), ("mode", "i4"), ("first", "3i4"), ("grid", "3i4"), ("lengths", "3f4"), ("angles", "3f4"),
    ("axes", "3i4"), ("least", "f4"), ("largest", "f4"), ("mean", "f4"), ("space_group", "i4"), ("extension", "i4"),
    ("others", "V56"), ("imod", "i4"), ("flags", "i4"), ("numbers", "V36"), ("origin", "3f4"), ("mark", "S3"),
])  # fmt: skip
STATEMENTS = FormatTable(
    "MRC and CCP4",
    (
        Statement("mapc", "place", "the axes of columns, rows and sections; also mapr and maps"),
        Statement("cella", "place", "the lengths of the cell"),
        Statement("mx", "place", "the number of samples along the cell; also my and mz"),
        Statement("cellb", "place", "the angles of the cell"),
        Statement("origin", "place", "the place of the first voxel"),
        Statement("nxstart", "place", "the number of the first voxel, without origin; also nystart and nzstart"),
        Statement("ispg", "meaning", "whether the file is a stack of volumes"),
        Statement("imodFlags", "values", "whether bytes have a sign, of IMOD"),
        Statement("dmax", "values", "the largest value, which shows whether bytes have a sign"),
        Statement("lskflg", "place", "a skew of the world, of CCP4", is_applied=False),
    ),
)

# The version numbers of the MRC standard of 2014, which has other fields in place of the skew.
_VERSIONS = range(20140, 20150)
# The fields of the skew of CCP4, a matrix and a shift of the world, within the field `others` of the header.
_SKEW = np.dtype([("flag", "i4"), ("matrix", "9f4"), ("shift", "3f4"), ("rest", "V4")])
# The bytes with the version of the standard, within the field `others` of the header.
_VERSION = slice(12, 16)
# The number in the field `imod` of a file that the program IMOD wrote.
_IMOD = 1146047817
# The bit of the field `flags` that says that bytes have a sign, in files of IMOD.
_HAS_SIGNED_BYTES = 1

# The types of voxels, by their mode: a number in the header.
_TYPES = {0: "i1", 1: "i2", 2: "f4", 6: "u2", 12: "f2"}
# The types of voxels that cannot be rendered, by their mode: a number in the header.
_OTHER_TYPES = {3: "complex integers", 4: "complex floats", 16: "colours of three bytes", 101: "integers of four bits"}
# Values of `ispg` for a stack of volumes: 400 and the number of a space group, from 1 to 230.
_VOLUME_STACKS = range(401, 631)

# The note on a file that is a stack of images by the standard MRC2014: it has space group 0 and a cell of one section.
_IMAGES = "the file says that its sections are separate images (ispg 0, mz 1); they are drawn as slices of a volume"


def read_mrc(path: Path, time: int | None, component: int | None) -> Image:
    """Read a map, or one volume of a stack, whose volumes are times; a stack of images is read as one volume.

    Raises InputError for damaged, truncated and foreign files, and if `time` or `component` do not fit.
    """
    start, is_compressed = read_start(path, _NUM_HEADER_BYTES)
    if len(start) < _NUM_HEADER_BYTES:
        raise _damaged(f"{len(start)} bytes of a header")
    # Sizes are below 2^16, which shows the byte order, whatever the header states: the high bytes are zeros.
    order: Literal["<", ">"] = "<" if int.from_bytes(start[:4], "little") < 2**16 else ">"
    header = np.frombuffer(start, _FIELDS.newbyteorder(order), 1)[0]
    sizes, mode, extension = header["sizes"].tolist(), int(header["mode"]), int(header["extension"])
    axes = header["axes"].tolist() if header["axes"].any() else [1, 2, 3]
    if sorted(axes) != [1, 2, 3] or min(sizes) < 1 or extension < 0:
        raise _damaged(f"sizes {sizes}, axes {axes} and {extension} bytes before the voxels")
    if mode not in _TYPES:
        known = ", ".join(f"{code} ({np.dtype(kind).name})" for code, kind in _TYPES.items())
        got = f"mode {mode}, {_OTHER_TYPES.get(mode, 'of no known type')}"
        raise InputError("voxels of this mode of MRC cannot be rendered", got=got, expected=known)
    is_signed = header["flags"] & _HAS_SIGNED_BYTES if header["imod"] == _IMOD else not header["largest"] > 127
    dtype = np.dtype(_TYPES[mode] if mode != 0 or is_signed else "u1").newbyteorder(order)
    shape, num_slices = (1, *sizes[::-1]), int(header["grid"][2])
    if header["space_group"] in _VOLUME_STACKS and num_slices > 0 and sizes[2] % num_slices == 0:
        shape = (sizes[2] // num_slices, num_slices, *shape[2:])
    part = StoredVoxels(path, 0, "deflate" if is_compressed else "raw", _NUM_HEADER_BYTES + extension, has_rest=True)
    chosen = choose("tsss", shape, time, component)
    values, left_over = read_stored(Layout(dtype, shape, (part,)), chosen)
    has_spacing = header["lengths"].min() > 0 and header["grid"].min() > 0
    spacing = header["lengths"] / header["grid"] if has_spacing else np.ones(3)
    columns = np.array(axes) - 1
    world_from_index = affine(spacing[columns], header["origin"], _cell(header["angles"])[:, columns])
    if not header["origin"].any() or header["mark"] != MRC_MARK:  # older headers have no origin
        world_from_index[:3, 3] = world_from_index[:3, :3] @ header["first"]
    unapplied = {"lskflg"} if _is_skewed(header["others"].tobytes(), order) else ()
    are_images = header["space_group"] == 0 and num_slices == 1 < sizes[2]
    notes = (
        _IMAGES if are_images else None,
        None if has_spacing else NO_SPACING,
        left_over,
        *chosen.notes,
        STATEMENTS.note(unapplied),
    )
    return Image(values, world_from_index, notes, steps=chosen.steps, units=Units("Å" if has_spacing else ""))


def _is_skewed(others: bytes, order: Literal["<", ">"]) -> bool:
    """Return whether a header of CCP4 has a skew that changes places. others: the field `others` of the header."""
    version = int.from_bytes(others[_VERSION], "little" if order == "<" else "big")
    skew = np.frombuffer(others, _SKEW.newbyteorder(order), 1)[0]
    is_neutral = np.array_equal(skew["matrix"].reshape(3, 3), np.eye(3)) and not skew["shift"].any()
    return skew["flag"] == 1 and version not in _VERSIONS and not is_neutral


def _cell(angles: Array) -> Float64:
    """Return unit vectors along the axes of a cell, float64 [3, 3]: the first along x, the second in the plane of x, y.

    angles: the angles between y and z, z and x, x and y, in degrees; 0 stands for 90. Impossible angles give NaN.
    """
    with np.errstate(all="ignore"):  # check_axes refuses axes that are not finite
        alpha, beta, gamma = np.cos(np.radians(np.where(angles, angles, 90.0), dtype=np.float64)).round(12)
        sine = np.sqrt(1 - gamma**2)
        y = (alpha - beta * gamma) / sine
        return np.array([[1.0, gamma, beta], [0.0, sine, y], [0.0, 0.0, np.sqrt(1 - beta**2 - y**2)]])


def _damaged(got: str) -> InputError:
    return InputError(
        "this is not an MRC file, or it is damaged",
        got=got,
        expected="a header of MRC or CCP4, whose sizes are positive and whose axes are 1, 2 and 3 in any order",
    )
