"""The sources of voxels of a scene's `volume` besides files with a header: raw files, formulas and arrays."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from renderer.scene import schema
from renderer.scene.schema import INVALID, KeyText, TreeNode
from renderer.scene.volume_files import file_field

# The names of the volumes that `renderer.readers.procedural` makes from formulas. The list is here so that names are
# checked without numpy.
PROCEDURAL_NAMES = (
    "engine_block",
    "constant",
    "single_voxel",
    "marschner_lobb",
    "cell_nuclei",
    "cell_membranes",
    "atlas",
    "beating_heart",
    "vessels",
    "cell_plasma_membrane",
    "cell_nucleus",
    "cell_reticulum",
    "cell_mitochondria",
    "cell_vesicles",
    "porous_rock",
    "storm",
    "flower",
)

ITEM_SIZES = {f"{kind}{8 * size}": size for size in (1, 2, 4, 8) for kind in ("uint", "int")}
ITEM_SIZES |= {f"float{8 * size}": size for size in (2, 4, 8)}
_ALIASES = {
    "byte": "uint8",
    "uchar": "uint8",
    "char": "int8",
    "ushort": "uint16",
    "short": "int16",
    "uint": "uint32",
    "int": "int32",
    "half": "float16",
    "float": "float32",
    "double": "float64",
    # Scanners and cameras store integers of 10, 12 and 14 bits in 16 bits.
    **{f"{sign}int{bits}": f"{sign}int16" for sign in ("", "u") for bits in (10, 12, 14)},
    **{f"{order}{name[0]}{size}": name for name, size in ITEM_SIZES.items() for order in ("", "<", "=", "|")},
    **{f">{name[0]}{size}": f"{name} with byte order big" for name, size in ITEM_SIZES.items()},
}

# The largest number of voxels along an axis. Together with MAX_VOXELS, it keeps indices of voxels, numbers of octree
# nodes and counts of bytes within 64 bits.
MAX_AXIS = 2**16
# The largest number of voxels of a volume: 4096 cubed. Below it, memory is the only limit.
MAX_VOXELS = 2**36


def _check_total(node: TreeNode, shape: tuple[Any, ...]) -> Any:
    total: int = math.prod(shape)
    if total <= MAX_VOXELS:
        return shape
    return node.reject("too many voxels", got=f"{total}", expected=f"at most {MAX_VOXELS} (4096 x 4096 x 4096)")


_SHAPE = schema.sequence_field(
    schema.integer_field(minimum=1, maximum=MAX_AXIS),
    f"[x, y, z]: three whole numbers from 1 to {MAX_AXIS}",
    count=3,
    check=_check_total,
)
SPACING_FIELD = schema.sequence_field(
    schema.still(schema.LENGTH_FIELD),
    f"[x, y, z]: three lengths from {schema.MIN_WORLD_LENGTH:g} to {schema.MAX_WORLD_LENGTH:g}",
    count=3,
)
# The numbers of voxels along x, y, z.
Shape = Annotated[
    tuple[int, int, int], _SHAPE, KeyText("The number of voxels along x, y and z.", example="[128, 128, 64]")
]
Spacing = Annotated[schema.Vector, SPACING_FIELD, KeyText("The size of a voxel along x, y and z.")]


@dataclass(frozen=True)
class RawSource:
    """A file of voxels without a header, in which x varies fastest.

    dtype: numpy's name of the voxels' type, without a byte order. offset: the number of bytes before the voxels.
    """

    key: ClassVar[str] = "raw"
    file: Annotated[
        Path,
        file_field("a file of voxels without a header", folder=False),
        KeyText("The file of the voxels, in which x varies fastest; relative to the scene's file.", example="a.raw"),
    ]
    shape: Shape
    dtype: Annotated[
        str,
        schema.choice_field(*ITEM_SIZES, aliases=_ALIASES),
        KeyText("The type of the voxels.", example="uint16"),
    ]
    byte_order: Annotated[Literal["little", "big"], KeyText("The order of the bytes of a voxel.")] = "little"
    spacing: Spacing = (1.0, 1.0, 1.0)
    offset: Annotated[
        int, schema.integer_field(minimum=0, maximum=2**40), KeyText("The number of bytes before the voxels.")
    ] = 0


@dataclass(frozen=True)
class ProceduralSource:
    """A volume made from a formula. phase: in beats of `beating_heart`, or in turns of `storm`."""

    key: ClassVar[str] = "procedural"
    name: Annotated[str, schema.choice_field(*PROCEDURAL_NAMES), KeyText("The formula that makes the voxels.")]
    shape: Shape
    seed: Annotated[
        int,
        schema.integer_field(minimum=0, maximum=2**32 - 1),
        KeyText("The seed of the random numbers of a formula."),
    ] = 1
    spacing: Spacing = (1.0, 1.0, 1.0)
    phase: Annotated[
        float,
        schema.number_field(minimum=-1e6, maximum=1e6),
        KeyText("The phase of `beating_heart`, in beats, or of `storm`, in turns."),
    ] = 0.0


@dataclass(frozen=True, eq=False)
class ArraySource:
    """An array of voxels in memory, for a scene that is made in Python: the value of `file` in its tree.

    values: a numpy array [z, y, x], which is never written to.
    name: the name of the volume in messages.
    affine: a 4 x 4 matrix, row by row, from voxel indices (x, y, z) to the world; None if the place is unknown.
    unit: the unit of world lengths; empty if unknown. world_axes: `LPS`, or empty, as in a Volume.
    spacing: replaces the spacing of the affine, whose directions and origin are kept.
    """

    key: ClassVar[str] = "array"
    values: Any = field(repr=False)
    name: str = "the array"
    affine: tuple[tuple[float, ...], ...] | None = None
    unit: str = ""
    world_axes: str = ""
    spacing: schema.Vector | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the number of voxels along x, y, z."""
        return tuple(self.values.shape[::-1])

    def written(self) -> dict[str, object]:
        """Return keys that describe the array, with their values. No scene can be read from them."""
        about = {"shape": self.shape, "dtype": str(self.values.dtype), "affine": self.affine}
        return {self.key: about, "spacing": self.spacing}


def check_raw(node: TreeNode, given: dict[str, Any]) -> None:
    """Refuse a raw file that has more or fewer bytes than its voxels. given: the values of the keys of `raw`."""
    file, shape, dtype, offset = given["file"], given["shape"], given["dtype"], given.get("offset", 0)
    if INVALID in (file, shape, dtype, offset) or INVALID in shape:
        return
    expected = offset + math.prod(shape) * ITEM_SIZES[dtype]
    found = file.stat().st_size
    if found == expected:
        return
    voxels = f"{' x '.join(map(str, shape))} voxels of {dtype}" + (f" after {offset} bytes" if offset else "")
    hint = "the file is cut short, or the shape or the dtype is not its own"
    if found > expected:
        hint = f"if the file begins with a header, set offset: {found - expected + offset}"
    node.child("file").reject("wrong size", got=f"{found} bytes", expected=f"{expected} bytes: {voxels}", hint=hint)
