"""Parse the scene's `volume`: the source of the voxels, checked as far as possible without reading them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from renderer.scene import schema, spec
from renderer.scene.message_text import did_you_mean, format_value
from renderer.scene.schema import INVALID, TreeNode

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
}

# 2**16 voxels along an axis and 2**36 (4096 cubed) in total keep all indices and byte counts within 64 bits, with room
# for node numbers. Any volume that fits in memory is accepted.
MAX_AXIS = 2**16
MAX_VOXELS = 2**36

_NONFINITE_WORDS = ("error", "lowest")


def _parse_nonfinite(node: TreeNode) -> Any:
    if isinstance(node.value, str) and node.value in _NONFINITE_WORDS:
        return node.value
    value = schema.number_field().parse(TreeNode(node.value, node.path, problems=[]))
    if value is INVALID:
        hint = did_you_mean(node.value, _NONFINITE_WORDS)
        return _NONFINITE.reject(node, "unknown value", hint=hint)
    return value


_NONFINITE = schema.FieldType("error, lowest or a finite number", _parse_nonfinite)

_HEADERLESS = (".raw", ".bin", ".dat")


def _triple(item: schema.FieldType[Any], words: str) -> schema.FieldType[Any]:
    return schema.sequence_field(item, f"[x, y, z]: {words}", count=3)


_SHAPE = _triple(schema.integer_field(minimum=1, maximum=MAX_AXIS), f"three whole numbers from 1 to {MAX_AXIS}")
_SPACING = _triple(schema.LENGTH_FIELD, f"three lengths from {spec.MIN_WORLD_LENGTH:g} to {spec.MAX_WORLD_LENGTH:g}")
_SUBSET_INDEX = schema.integer_field(minimum=0, maximum=10**6)  # a time step or a component, counted from 0
_CROP = schema.sequence_field(
    schema.sequence_field(
        schema.integer_field(minimum=0, maximum=MAX_AXIS),
        "[first, end]: whole numbers with first less than end",
        count=2,
    ),
    "[[x first, x end], [y first, y end], [z first, z end]]: voxel numbers from 0, each end one past the last",
    count=3,
)


def volume_field_type(base: Path) -> schema.FieldType[spec.VolumeSpec]:
    """Return the type of `volume`; its files are relative to the folder `base`."""
    raw: schema.FieldTable = {
        "file": _file_field_type(base, folder=False),
        "shape": _SHAPE,
        "dtype": schema.choice_field(*ITEM_SIZES, aliases=_ALIASES),
        "byte_order": schema.choice_field("little", "big"),
        "spacing": _SPACING,
        "offset": schema.integer_field(minimum=0, maximum=2**40),
    }
    procedural: schema.FieldTable = {
        "name": schema.choice_field(*spec.PROCEDURAL_NAMES),
        "shape": _SHAPE,
        "seed": schema.integer_field(minimum=0, maximum=2**32 - 1),
        "spacing": _SPACING,
    }
    table: schema.FieldTable = {
        "file": _file_field_type(base, folder=True),
        "raw": schema.section_field(raw, _build_raw, required=("file", "shape", "dtype")),
        "procedural": schema.section_field(procedural, _build_procedural, required=("name", "shape")),
        "spacing": _SPACING,
        "time": _SUBSET_INDEX,
        "component": _SUBSET_INDEX,
        "crop": _CROP,
        "nonfinite": _NONFINITE,
    }
    hint = "an array in memory, of a film that was made in Python: save it with numpy.save, and name that file"
    return schema.section_field(table, _build_volume, misplaced_hints={"array": hint})


def _build_volume(node: TreeNode, given: dict[str, Any]) -> spec.VolumeSpec:
    sources = [key for key in ("file", "raw", "procedural") if key in given]
    if not sources:
        node.add_problem("no voxels", expected="one of file, raw and procedural")
    for extra in sources[1:]:
        node.key(extra).add_problem(f"contradicts {node.path}.{sources[0]}", expected="one source of voxels")
    own = given.get("raw", given.get("procedural"))
    source = spec.FileSource(given["file"], given.get("spacing")) if "file" in given else own
    rest = {key: value for key, value in given.items() if key not in (*sources, "spacing")}
    if isinstance(source, (spec.RawSource, spec.ProceduralSource)):
        if "spacing" in given:
            what, place = f"a {sources[0]} volume has its own spacing", f"{node.path}.{sources[0]}.spacing"
            node.key("spacing").add_problem(what, hint=f"give {place} instead")
        for key in schema.valid_keys(given, "time", "component"):
            node.key(key).add_problem(
                f"a {sources[0]} volume has neither time steps nor components", hint="remove the key"
            )
    if "crop" in given:
        _check_crop(node.child("crop"), given["crop"], getattr(source, "shape", None))
    return spec.VolumeSpec(source=source, **rest)  # type: ignore[arg-type]  # an INVALID source never leaves parse_scene


def _build_procedural(node: TreeNode, given: dict[str, Any]) -> spec.ProceduralSource:
    if schema.valid_keys(given, "shape"):
        _check_total(node.child("shape"), given["shape"])
    return spec.ProceduralSource(**given)


def _build_raw(node: TreeNode, given: dict[str, Any]) -> spec.RawSource:
    if not (schema.valid_keys(given, "shape") and _check_total(node.child("shape"), given["shape"])):
        return spec.RawSource(**given)
    if len(schema.valid_keys(given, "file", "dtype")) == 2 and isinstance(given.get("offset", 0), int):
        shape, offset = given["shape"], given.get("offset", 0)
        expected = offset + math.prod(shape) * ITEM_SIZES[given["dtype"]]
        found = given["file"].stat().st_size
        if found != expected:
            node.child("file").add_problem(
                "wrong size",
                got=f"{found} bytes",
                expected=f"{expected} bytes: {' x '.join(map(str, shape))} voxels of {given['dtype']}"
                + (f" after {offset} bytes" if offset else ""),
                hint=f"if the file begins with a header, set offset: {found - expected + offset}"
                if found > expected
                else "the file is cut short, or the shape or the dtype is not its own",
            )
    return spec.RawSource(**given)


def _check_total(node: TreeNode, shape: tuple[Any, ...]) -> bool:
    """Return whether these are three axis lengths of a volume of legal size."""
    if not all(isinstance(length, int) for length in shape):
        return False
    total: int = math.prod(shape)
    if total > MAX_VOXELS:
        node.add_problem("too many voxels", got=f"{total}", expected=f"at most {MAX_VOXELS} (4096 x 4096 x 4096)")
    return total <= MAX_VOXELS


def _check_crop(node: TreeNode, crop: Any, shape: Any) -> None:
    """Check that ranges hold a voxel and lie in the volume, if its shape is known."""
    for index, pair in enumerate(crop if isinstance(crop, tuple) else ()):
        if not (isinstance(pair, tuple) and all(isinstance(end, int) for end in pair)):
            continue
        place = node.child(index)
        first, end = pair
        if first >= end:
            place.add_problem(
                "an empty range", got=format_value(pair), expected="[first, end] with first less than end"
            )
        elif isinstance(shape, tuple) and isinstance(shape[index], int) and end > shape[index]:
            place.add_problem(
                "outside the volume", got=format_value(pair), expected=f"an end of at most {shape[index]}"
            )


def _file_field_type(base: Path, *, folder: bool) -> schema.FieldType[Path]:
    """Return the type of an existing file (or folder), relative to `base`."""

    def parse(node: TreeNode) -> Path:
        if not isinstance(node.value, str) or not node.value.strip() or "\0" in node.value:
            return field.reject(node, "not a file name")
        path = base / node.value
        got = str(path) if str(path).isprintable() else repr(str(path))
        try:
            is_file, is_folder, is_other = path.is_file(), path.is_dir(), path.exists()
        except OSError as error:  # a folder without permission, a name that is too long
            return field.reject(node, f"cannot be read: {error.strerror}", got=format_value(str(path)))
        if folder and is_file and path.suffix.lower() in _HEADERLESS:
            hint = "give volume.raw: {file: ..., shape: [...], dtype: ...} instead"
            return field.reject(node, "a file without a header", got=got, hint=hint)
        if is_folder and not folder:
            return field.reject(node, "a folder", got=got)
        if is_file or is_folder:
            return path
        if is_other:
            return field.reject(node, "neither a file nor a folder", got=got, hint="write a pipe's content to a file")
        return field.reject(node, "no such file", got=got, hint=_missing_file_hint(path))

    field = schema.FieldType(_VOLUME_FILE_WORDS if folder else "a file of voxels without a header", parse)
    return field


_VOLUME_FILE_WORDS = "an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices"


def _missing_file_hint(path: Path) -> str | None:
    """Return a hint for a missing file."""
    try:
        others = sorted(entry.name for entry in path.parent.iterdir() if entry.suffix not in (".yaml", ".yml"))
    except (OSError, ValueError):
        return schema.TILDE_HINT if "~" in path.parts else "its folder is not there, either"
    return did_you_mean(path.name, others)
