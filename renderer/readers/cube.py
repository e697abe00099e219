"""Read Gaussian cube files (.cube): text files with a header, a list of atoms, and values on a grid, x slowest.

Format: https://gaussian.com/cubegen/. Lengths stay in the unit of the file: bohr, or angstrom if the numbers of voxels
are negative. A negative number of atoms announces a line that numbers several orbitals; each orbital is a component.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import affine
from renderer.readers.components import MAX_LISTED, choose
from renderer.readers.image import Image
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.stored import Layout, StoredVoxels, read_stored
from renderer.readers.text_header import Field
from renderer.readers.units import units_of
from renderer.scene import short_text

STATEMENTS = FormatTable(
    "Gaussian cube",
    (
        Statement("origin", "place", "the place of the first voxel"),
        Statement("axes", "place", "the direction and the step of each axis"),
        Statement("sign of the number of voxels", "meaning", "whether lengths are in bohr or angstrom"),
        Statement("sign of the number of atoms", "meaning", "whether there are several orbitals"),
        Statement("NVal", "meaning", "the number of values of a voxel"),
    ),
)

# The largest number of lines of a header, which has a line for each atom: more than any molecule has atoms.
_MAX_LINES = 2**17

# A line of the header must be shorter than this, in bytes.
_MAX_LINE_BYTES = 4096


def read_cube(path: Path, time: int | None, component: int | None) -> Image:
    """Read one orbital, or other component, of a cube file, as float32.

    Raises InputError for damaged and truncated files, and if `time` or `component` do not fit.
    """
    with path.open("rb") as file:
        lines = _lines(file, path)
        next(lines), next(lines)  # the file begins with two lines of comments
        first = next(lines)
        names = list[str]()
        num_atoms, *origin = first.numbers(4 + (len(first.text.split()) == 5))
        num_values = int(origin.pop()) if len(origin) == 4 else 1
        steps = [next(lines).numbers(4) for _ in range(3)]
        shape = tuple(abs(int(step[0])) for step in steps)
        for _ in range(abs(int(num_atoms))):
            next(lines)
        if num_atoms < 0:
            num_values, names = _orbitals(lines)
        offset = file.tell()
    counts = [num_atoms, *(step[0] for step in steps)]
    if min(*shape, num_values) < 1 or not all(map(float.is_integer, counts)):
        raise first.error("a whole number of atoms, and below it three of voxels")
    layout = Layout(np.dtype(np.float32), (*shape, num_values), (StoredVoxels(path, offset, "text"),))
    chosen = choose("sssc", layout.shape, time, component, names)
    values, left_over = read_stored(layout, chosen)
    world_from_index = affine(np.ones(3), origin, np.transpose([step[1:] for step in steps]))
    are_bohr = {n > 0 for n in counts[1:]}
    units = units_of({True: "bohr", False: "Å"}[are_bohr.pop()] if len(are_bohr) == 1 else "")
    notes = (left_over, *chosen.notes)
    return Image(values.transpose(2, 1, 0), world_from_index, notes, channels=chosen.channels, units=units)


def _orbitals(lines: Iterator[Field]) -> tuple[int, list[str]]:
    """Return the number of orbitals, and the names of at least the first MAX_LISTED of them."""
    first = next(lines)
    count = int(first.numbers(len(first.text.split()))[0])
    names, words = list[str](), first.text.split()[1:]
    num_left = count
    while num_left > len(words):
        names, num_left = [*names, *words][:MAX_LISTED], num_left - len(words)
        words = next(lines).text.split()
    return count, [f"orbital {short_text(name)}" for name in [*names, *words[: max(num_left, 0)]]]


def _lines(file: IO[bytes], path: Path) -> Iterator[Field]:
    """Yield the lines of the header; raises InputError where the file ends, and for too many or too long lines."""
    for number in itertools.count(1):
        line = file.readline(_MAX_LINE_BYTES)
        if not line or len(line) == _MAX_LINE_BYTES or number > _MAX_LINES:
            raise InputError(
                "the header of this cube file does not end" if line else "this cube file ends within its header",
                where=f"{path}:{number}",
                hint="the file is truncated or damaged",
            )
        yield Field(f"line {number}", os.fsdecode(line).strip(), f"{path}:{number}")
