"""Read FreeSurfer's MGH (.mgh, .mgz): a big-endian header of fixed length, and voxels behind it, x fastest.

Format: https://surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat. RAS becomes LPS. The header gives the position
of the middle of the volume, voxel `size / 2`. Frames are time steps. Of the fields behind the voxels, only the time
between frames is read.
"""

from __future__ import annotations

import gzip
import math
import struct
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import affine, in_lps
from renderer.readers.components import choose
from renderer.readers.image import Image
from renderer.readers.sniff import read_start
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.steps_in_time import TimeSteps, even_steps_at
from renderer.readers.stored import Layout, StoredVoxels, read_stored
from renderer.readers.units import Units
from renderer.volume import Float64

# The fields of the header: version, sizes along x, y, z and time, type, degrees of freedom, and a flag that says
# whether the placement behind it is valid: spacing, directions and middle in RAS.
_HEADER = struct.Struct(">7ih15f")
# The length of an MGH header with its padding, in bytes.
_NUM_HEADER_BYTES = 284
# The types of voxels, by their numbers in the header.
_TYPES = {0: ">u1", 1: ">i4", 3: ">f4", 4: ">i2", 10: ">u2"}

STATEMENTS = FormatTable(
    "MGH",
    (
        Statement("delta", "place", "the sizes of voxels"),
        Statement("Mdc", "place", "the directions of the axes"),
        Statement("Pxyz_c", "place", "the place of the middle"),
        Statement("goodRASFlag", "place", "whether sizes, directions and place are given"),
        Statement("tr", "meaning", "the time between frames, behind the voxels"),
    ),
)

# The placement that the format prescribes if the flag in the header is 0: coronal slices with a spacing of 1 mm.
_CORONAL = (
    *(1.0, 1.0, 1.0),  # the spacing
    *(-1.0, 0.0, 0.0),  # the direction of x
    *(0.0, 0.0, -1.0),  # the direction of y
    *(0.0, 1.0, 0.0),  # the direction of z
    *(0.0, 0.0, 0.0),  # the middle of the volume
)
_NO_PLACE = "the file does not give its place; coronal slices of 1 x 1 x 1 mm are assumed, as FreeSurfer does"


def read_mgh(path: Path, time: int | None, component: int | None) -> Image:
    """Read one frame of an MGH file.

    Raises InputError for damaged, truncated and foreign files, and if `time` or `component` do not fit.
    """
    start, is_compressed = read_start(path, _HEADER.size)
    version, *sizes, kind, _, flag = _HEADER.unpack(start)[:8] if len(start) == _HEADER.size else [0] * 8
    if version != 1:
        raise InputError("this is not an MGH file, or it is damaged", expected="a header of MGH, version 1")
    if kind not in _TYPES:
        types = ", ".join(f"{code} ({np.dtype(dtype).name})" for code, dtype in _TYPES.items())
        raise InputError("voxels of this type of MGH cannot be rendered", got=f"type {kind}", expected=types)
    part = StoredVoxels(path, 0, "deflate" if is_compressed else "raw", _NUM_HEADER_BYTES, has_rest=True)
    chosen = choose("tsss", shape := tuple(sizes[::-1]), time, component)
    values, _ = read_stored(Layout(np.dtype(_TYPES[kind]), shape, (part,)), chosen)
    ras_from_index = _ras_from_index(sizes[:3], _HEADER.unpack(start)[8:] if flag > 0 else _CORONAL)
    notes = (None if flag > 0 else _NO_PLACE, *chosen.notes)
    units = Units("mm", "LPS") if flag > 0 else Units()
    steps = _steps(part, sizes[3], math.prod(shape) * values.itemsize)
    return Image(values, in_lps(ras_from_index, (-1.0, -1.0, 1.0)), notes, steps=steps, units=units)


def _steps(part: StoredVoxels, count: int, num_bytes: int) -> TimeSteps:
    """Return the steps in time, by the first number behind the voxels: the milliseconds between two frames."""
    if count == 1:
        return TimeSteps(count)
    content = b""
    read = gzip.open if part.encoding == "deflate" else open
    with suppress(EOFError, OSError, zlib.error), read(part.file, "rb") as opened:  # the file may end at the voxels
        opened.seek(_NUM_HEADER_BYTES + num_bytes)
        content = opened.read(4)
    step = float(str(np.frombuffer(content, ">f4")[0])) if len(content) == 4 else 0.0
    return even_steps_at(count, step, "ms") if step > 0 else TimeSteps(count)


def _ras_from_index(sizes: list[int], place: tuple[float, ...]) -> Float64:
    """Return the affine from voxel indices to RAS, float64 [4, 4].

    place: spacing, the directions of the index axes, and the middle.
    """
    world_from_index = affine(place[:3], np.zeros(3), np.reshape(place[3:12], (3, 3)).T)
    with np.errstate(over="ignore", invalid="ignore"):  # an affine that is not finite is refused later
        world_from_index[:3, 3] = place[12:] - world_from_index[:3, :3] @ (np.array(sizes) / 2)
    return world_from_index
