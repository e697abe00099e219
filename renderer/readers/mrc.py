"""Read MRC and CCP4 (.mrc, .map, .ccp4, .rec, also below gzip): a header of fixed length, and voxels behind it.

Format: https://www.ccpem.ac.uk/mrc_format/mrc2014.php. Lengths are in angstrom. Columns, rows and sections run along
the axes of the cell in any order, whose angles may be others than 90 degrees. The place is `ORIGIN`, or if that is 0,
`NSTART`.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Literal

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import NO_SPACING, Image, choice_notes
from renderer.readers.sniff import MRC_MARK, MRC_MARK_AT, read_start
from renderer.readers.stored import Encoding, Layout, StoredVoxels, left_over_note, read_stored
from renderer.volume import Float64

_NUM_HEADER_BYTES = 1024
# Sizes, mode, NSTART, MX to MZ; lengths and angles of the cell; axes; the range of values; space group, and the bytes
# of the header's extension. Elsewhere: IMOD's mark and flags, the origin, and the byte order, whose first byte counts.
_FIELDS = "10i6f3i3f2i"
_IMOD_AT, _ORIGIN_AT, _STAMP_AT = 152, 196, 212
_IMOD, _HAS_SIGNED_BYTES = 1146047817, 1
_TYPES = {0: "i1", 1: "i2", 2: "f4", 6: "u2", 12: "f2"}
_OTHER_TYPES = {3: "complex integers", 4: "complex floats", 16: "colours of three bytes", 101: "integers of four bits"}
_FIRST_VOLUME_STACK, _NUM_SPACE_GROUPS = 401, 230


def read_mrc(path: Path, time: int | None, component: int | None) -> Image:
    """Read a map, or one of a stack of volumes, which are times; a stack of images is a volume.

    Raises InputError for damaged, truncated and foreign files, and if `time` or `component` do not fit.
    """
    start, is_compressed = read_start(path, _NUM_HEADER_BYTES)
    if len(start) < _NUM_HEADER_BYTES:
        raise _damaged(f"{len(start)} bytes of a header")
    order = _byte_order(start)
    fields = struct.unpack_from(order + _FIELDS, start)
    sizes, mode, first, grid = fields[:3], fields[3], fields[4:7], fields[7:10]
    lengths, angles, axes = fields[10:13], fields[13:16], fields[16:19]
    space_group, num_extension = fields[22:]
    axes = (1, 2, 3) if axes == (0, 0, 0) else axes
    if sorted(axes) != [1, 2, 3] or min(sizes) < 1 or num_extension < 0:
        raise _damaged(f"sizes {sizes}, axes {axes} and {num_extension} bytes before the voxels")
    if mode not in _TYPES:
        known = ", ".join(f"{code} ({np.dtype(kind).name})" for code, kind in _TYPES.items())
        got = f"mode {mode}, {_OTHER_TYPES.get(mode, 'of no known type')}"
        raise InputError("voxels of this mode of MRC cannot be rendered", got=got, expected=known)
    stamp, flags = struct.unpack_from(order + "2i", start, _IMOD_AT)
    is_unsigned = mode == 0 and stamp == _IMOD and not flags & _HAS_SIGNED_BYTES
    dtype = np.dtype("u1" if is_unsigned else _TYPES[mode]).newbyteorder(order)
    shape = (1, *sizes[::-1])
    if 0 <= space_group - _FIRST_VOLUME_STACK < _NUM_SPACE_GROUPS and grid[2] > 0 and sizes[2] % grid[2] == 0:
        shape = (sizes[2] // grid[2], grid[2], *shape[2:])
    encoding: Encoding = "deflate" if is_compressed else "raw"
    num_skipped = _NUM_HEADER_BYTES + num_extension
    layout = Layout(dtype, shape, (StoredVoxels(path, 0, encoding, num_skipped, has_rest=True),))
    values, num_left = read_stored(layout, "tsss", time, component)
    has_spacing = min(lengths) > 0 and min(grid) > 0
    steps = _cell(angles) * (np.divide(lengths, grid) if has_spacing else 1.0)
    order_of_axes = [axis - 1 for axis in axes]
    world_from_index = np.eye(4)
    world_from_index[:3, :3] = steps[:, order_of_axes]
    origin = np.array(struct.unpack_from(order + "3f", start, _ORIGIN_AT), np.float64)
    if not origin.any() or start[MRC_MARK_AT : MRC_MARK_AT + 3] != MRC_MARK:  # older headers have no origin
        origin = world_from_index[:3, :3] @ np.array(first, np.float64)
    world_from_index[:3, 3] = origin
    left_over = left_over_note(layout, num_left, None)
    notes = (None if has_spacing else NO_SPACING, left_over, *choice_notes("tsss", shape, time, component))
    return Image(values, world_from_index, notes)


def _byte_order(start: bytes) -> Literal["<", ">"]:
    """Return the byte order that the stamp says, or in which the mode is a small number."""
    is_unstamped = start[_STAMP_AT] not in (0x44, 0x11)
    is_big = struct.unpack_from("<i", start, 12)[0] >= 2**16 if is_unstamped else start[_STAMP_AT] == 0x11
    return ">" if is_big else "<"


def _cell(angles: tuple[float, ...]) -> Float64:
    """Return unit vectors along the axes of a cell, float64 [3, 3], of which the first is x and the second in x, y.

    angles: between y and z, z and x, x and y, in degrees; 0 stands for 90. What is no cell becomes NaN.
    """
    with np.errstate(all="ignore"):  # check_axes refuses what is not finite
        alpha, beta, gamma = (np.cos(np.radians([angle or 90.0 for angle in angles])) * 1e12).round() / 1e12
        sine = np.sqrt(1 - gamma**2)
        y = (alpha - beta * gamma) / sine
        return np.array([[1.0, gamma, beta], [0.0, sine, y], [0.0, 0.0, np.sqrt(1 - beta**2 - y**2)]])


def _damaged(got: str) -> InputError:
    return InputError(
        "this is not an MRC file, or it is damaged",
        got=got,
        expected="a header of MRC or CCP4, whose sizes are positive and whose axes are 1, 2 and 3 in any order",
    )
