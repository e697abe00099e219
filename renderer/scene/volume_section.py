"""The scene's `volume`: the source of the voxels, checked as far as possible without reading them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

from renderer.scene import schema
from renderer.scene.level_choice import LevelChoice
from renderer.scene.message_text import format_value
from renderer.scene.motion import Motion, OverFrames, at_keys, is_plain, moving_result
from renderer.scene.schema import INVALID, KeyText, TreeNode
from renderer.scene.volume_files import SOURCE_FIELD, FileSource, UrlSource
from renderer.scene.volume_sources import (
    MAX_AXIS,
    SPACING_FIELD,
    ArraySource,
    ProceduralSource,
    RawSource,
    check_raw,
)
from renderer.system import printable

# A transform counts as invertible if its determinant is at least this, after its largest entry is scaled to 1.
_MIN_DETERMINANT = 1e-9


def _check_pair(node: TreeNode, pair: tuple[Any, ...]) -> Any:
    first, end = pair
    return pair if first < end else node.reject("an empty range", expected="[first, end] with first less than end")


SUBSET_INDEX_FIELD = schema.integer_field(minimum=0, maximum=10**6)  # the number of a time step or a component
_STEP = schema.number_field(minimum=0, maximum=10**6)


def _parse_step(node: TreeNode) -> Any:
    step = _STEP.parser(node)
    return int(step) if isinstance(step, float) and step.is_integer() else step


_TIME = schema.word_or({"auto": "auto"}, replace(_STEP, parser=_parse_step), f"auto, or {_STEP.expected}")
_MAX_UNIT_LENGTH = 12


def is_unit(text: str) -> bool:
    """Return whether a text, which may come from any file, can be shown as a unit."""
    has_text = bool(text.strip()) and not text.strip().isdigit()
    return has_text and len(text) <= _MAX_UNIT_LENGTH and printable(text) == text


_UNIT = schema.text_field(f"a unit such as mm or µm, of at most {_MAX_UNIT_LENGTH} characters", "no unit", is_unit)
# The values of `component` that need no transfer function in the scene.
WITHOUT_TRANSFER = ("all", "color", "color_alpha")
_COMPONENT = schema.word_or(
    {word: word for word in WITHOUT_TRANSFER},
    SUBSET_INDEX_FIELD,
    f"all, color, color_alpha, or {SUBSET_INDEX_FIELD.expected}",
)
_DATASET = schema.text_field(
    "the name of a dataset in an HDF5 or netCDF-4 file, or of an image in a store", "no name", str.strip
)
# The ends of the names of archives that may hold a store.
_ARCHIVES = (".zip", ".ozx")
# The largest number of a level: at the 31st, the longest axis has one voxel.
_MAX_LEVEL = 31
_NUMBER_OF_LEVEL = schema.integer_field(minimum=0, maximum=_MAX_LEVEL)
_LEVEL = schema.word_or({"auto": None}, _NUMBER_OF_LEVEL, f"auto, or {_NUMBER_OF_LEVEL.expected}")
_RANGE = schema.sequence_field(
    schema.integer_field(minimum=0, maximum=MAX_AXIS),
    "[first, end]: whole numbers with first less than end",
    count=2,
    check=_check_pair,
    motion="linear",
)
_CROP_WORDS = "[[x first, x end], [y first, y end], [z first, z end]]: voxel numbers from 0, each end one past the last"
_RANGES = schema.sequence_field(_RANGE, _CROP_WORDS, count=3)


def _parse_crop(node: TreeNode) -> Any:
    if not isinstance(node.value, Mapping):
        return _RANGES.parser(node)
    ranges = schema.read_fields(node, _AXES)
    return tuple(ranges.get(axis) for axis in _AXES)


_AXES: schema.FieldTable = {
    axis: schema.described(_RANGE, f"The voxels along {axis}: the first, and the one after the last.") for axis in "xyz"
}
_CROP = schema.FieldType(
    f"{_CROP_WORDS}; or a mapping with some of x, y and z",
    _parse_crop,
    motion="linear",
    plain_schema=lambda moves: schema.any_of(_RANGES.plain_schema(moves), schema.mapping_schema(_AXES, moves=moves)),
)

_NUMBERS = schema.sequence_field(schema.number_field(motion=None), "a list of numbers")


def _parse_nodata(node: TreeNode) -> Any:
    if isinstance(node.value, (list, tuple)):
        return _NUMBERS.parser(node)
    value = schema.number_field().parser(node)
    return value if value is INVALID else (value,)


_NODATA_WORDS = "auto, none, a number, or a list of numbers"
_NODATA = schema.word_or(
    {"auto": "auto", "none": "none"},
    schema.FieldType(_NODATA_WORDS, _parse_nodata, plain_schema=schema.either(schema.number_field(), _NUMBERS)),
    _NODATA_WORDS,
)


def _check_transform(node: TreeNode, rows: tuple[Any, ...]) -> Any:
    if any(INVALID in row for row in rows):
        return INVALID
    (a, b, c, _), (d, e, f, _), (g, h, i, _), last = rows
    if last != (0, 0, 0, 1):
        return node.child(3, list(last)).reject("not affine", expected="[0, 0, 0, 1]")
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    if abs(determinant) < _MIN_DETERMINANT * max(map(abs, (a, b, c, d, e, f, g, h, i))) ** 3:
        return node.reject("flat: it leaves the volume no depth", expected="a matrix that can be inverted")
    return rows


TRANSFORM_FIELD = schema.described(
    schema.sequence_field(
        schema.sequence_field(schema.still(schema.COORDINATE_FIELD), "four numbers", count=4),
        "a matrix of 4 x 4 numbers, row by row, whose last row is [0, 0, 0, 1]",
        count=4,
        check=_check_transform,
        motion="linear",
    ),
    "A matrix that moves the volume in the world.",
    words="no change",
    example="[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
)

# A range of voxels along an axis: the number of the first voxel, and of the voxel after the last one.
Range = tuple[int, int]
Ranges = tuple[Range | None, Range | None, Range | None]


@dataclass(frozen=True)
class VolumeSpec:
    """A source of voxels, and the part of it that is used.

    time: the number of a step in time, from 0 on; `auto` shows all steps in the course of the film.
    component: the number of a component, from 0 on. `all` makes a layer of each component; `color` reads voxels that
        are colours, with their luminance as scalars, and `color_alpha`, with their alpha as scalars.
    crop: half-open ranges of voxels (first, one past the last) along x, y, z; None for all voxels along an axis.
    interpolate: whether two steps are mixed at a `time` between them; `time` is then a float, and else an int.
    unit: the unit of world lengths, in place of the file's unit.
    level: the number of a level of a store or of a file with levels, 0 for the finest; None for the coarsest level of a
        store that is as exact as the scene asks, and for the finest level of a file that fits into memory.
        A crop is in voxels of the finest level, and so is the spacing of the source.
    chosen: the choice that `level` is the result of. It changes no picture.
    """

    source: FileSource | UrlSource | RawSource | ProceduralSource | ArraySource
    time: Annotated[
        float | int | Literal["auto"] | None,
        _TIME,
        KeyText(
            "The number of a step in time, from 0. `auto`: all steps in the course of the film.",
            "the first",
            "0",
        ),
    ] = None
    component: Annotated[
        int | Literal["all", "color", "color_alpha"] | None,
        _COMPONENT,
        KeyText(
            "The number of a component, from 0. `all`: each is a volume. `color`, `color_alpha`: voxels "
            "are colors, with their luminance or alpha as values.",
            "the first",
            "0",
        ),
    ] = None
    crop: Annotated[
        Ranges | None,
        _CROP,
        KeyText(
            "The voxels that are read: along each axis the first, and the one after the last. {z: [0, "
            "50]} crops one axis.",
            "all",
            "[[0, 100], [20, 80], [0, 50]]",
        ),
    ] = None
    nodata: Annotated[
        Literal["auto", "none"] | tuple[float, ...],
        _NODATA,
        KeyText(
            "The values that are no data: a number or a list. `auto`: NaN, infinities and fill values. "
            "`none`: all are data."
        ),
    ] = "auto"
    dataset: Annotated[
        str | None,
        _DATASET,
        KeyText(
            "The name of a dataset of an HDF5 or netCDF-4 file, or of an image of a store.",
            "the only one that is a volume",
            "in/volume",
        ),
    ] = None
    interpolate: Annotated[bool, KeyText("Whether a `time` between two steps shows a mixture of both.")] = False
    unit: Annotated[str | None, _UNIT, KeyText("The unit of lengths.", "the file's", "mm")] = None
    level: Annotated[
        int | None,
        _LEVEL,
        KeyText("The level of a store, 0 the finest; `auto`: the coarsest that is as exact as `error` asks."),
    ] = None
    chosen: LevelChoice | None = field(default=None, compare=False)

    @property
    def has_open_level(self) -> bool:
        """Return whether a level is to be chosen, if the source is a store, as its name or a folder may be."""
        if self.level is not None:
            return False
        if isinstance(self.source, FileSource):
            is_archive = self.source.file.suffix.lower() in _ARCHIVES
            return not self.source.steps and (is_archive or self.source.file.is_dir())
        return isinstance(self.source, UrlSource)

    @property
    def has_colors(self) -> bool:
        """Return whether the voxels are colours, so that they are drawn in their own colours."""
        return self.component in ("color", "color_alpha")

    def written(self) -> dict[str, object]:
        """Return the section as a scene file has it: first the keys of the source, then all others, with values."""
        own = {key: value for key, value in vars(self).items() if key not in ("source", "chosen")}
        own |= {"crop": at_keys(_by_axis, self.crop), "interpolate": self.interpolate or None}
        source = self.source
        if isinstance(source, (RawSource, ProceduralSource)):
            return {source.key: source} | own
        return source.written() | own


def _by_axis(crop: Ranges | None) -> dict[str, Range] | Ranges | None:
    """Return a crop as it is written in a scene: as a mapping if some axes have no range."""
    if crop is None or None not in crop:
        return crop
    return {axis: span for axis, span in zip("xyz", crop, strict=True) if span is not None}


def steps_in_time(volume: OverFrames[VolumeSpec]) -> list[VolumeSpec]:
    """Return a volume at each step in time that the film shows or mixes, in ascending order.

    All keys but `time` have their values of frame 0. If the time does not move, only the volume itself is returned.
    """
    plain, motions = volume.at(0), volume.map(lambda spec: spec.time).motions
    if not motions:
        return [plain]
    (motion,) = motions
    times: Sequence[float] = motion.values
    if motion.easing != "hold":
        times = [motion.at(frame) for frame in range(motion.frames[0], motion.frames[-1] + 1)]
        if len(times) > max(times) - min(times):  # the film is slow enough to show every step
            times = range(math.floor(min(times)), math.ceil(max(times)) + 1)
    steps = sorted({whole for time in times for whole in (math.floor(time), math.ceil(time))})
    return [replace(plain, time=step) for step in steps]


def build_volume(node: TreeNode, given: dict[str, Any]) -> VolumeSpec:
    """Return a volume from the given keys of VOLUME_TABLE, and add problems of keys that contradict each other."""
    sources = [key for key in _SOURCES if key in given]
    if not sources:
        node.reject("no voxels", got="", expected="one of file, raw and procedural")
    for extra in sources[1:]:
        node.key(extra).reject(f"contradicts {node.path}.{sources[0]}", expected="one source of voxels")
    own = given.get("raw", given.get("procedural"))
    source = given.get("file", own)
    if isinstance(source, (FileSource, UrlSource, ArraySource)):
        source = replace(source, spacing=given.get("spacing"))
    rest = {key: value for key, value in given.items() if key not in (*sources, "spacing")}
    if isinstance(source, (RawSource, ProceduralSource)):
        kind = f"a {sources[0]} volume has"
        if "spacing" in given:
            hint = f"give {node.path}.{sources[0]}.spacing instead"
            node.key("spacing").reject(f"{kind} its own spacing", hint=hint)
        for key in schema.valid_keys(given, "time", "interpolate", "component", "dataset", "level"):
            node.key(key).reject(f"{kind} neither time steps, components, datasets nor levels", hint="remove the key")
    shape, crop = getattr(source, "shape", INVALID), given.get("crop", INVALID)
    pairs = () if INVALID in (crop, shape) or not is_plain(crop) else zip(crop, shape, strict=True)
    is_by_name = isinstance(node.value, Mapping) and isinstance(node.value.get("crop"), Mapping)
    for axis, (pair, length) in zip("xyz" if is_by_name else range(3), pairs, strict=False):
        if None not in (pair, length) and INVALID not in (pair, length) and INVALID not in pair and pair[1] > length:
            expected = f"an end of at most {length}"
            node.child("crop").child(axis, pair).reject("outside the volume", expected=expected)
    if "time" in rest:
        rest["time"] = _as_step(node.child("time"), rest["time"], interpolates=rest.get("interpolate") is True)
    return VolumeSpec(source=source, **rest)  # type: ignore[arg-type]  # an INVALID source never leaves parse_scene


def _as_step(node: TreeNode, time: Any, *, interpolates: bool) -> Any:
    """Return a time, which may move, as a float if steps are interpolated; else check that it is a whole number."""
    if time is INVALID or time == "auto":
        return time
    if interpolates:
        return moving_result(float, time)
    for value in time.values if isinstance(time, Motion) else (time,):
        if isinstance(value, float):
            expected, hint = SUBSET_INDEX_FIELD.expected, "`interpolate: true` mixes the two steps beside it"
            return node.reject("not a whole number", got=format_value(value), expected=expected, hint=hint)
    return time


def _parse_file(node: TreeNode) -> Any:
    """Return the source of a file's name; an array in memory, which is in no text, is a source itself."""
    return node.value if isinstance(node.value, ArraySource) else SOURCE_FIELD.parser(node)


_ARRAY_HINT = "an array in memory, of a film that was made in Python: save it with numpy.save, name it by --volume"
_NONFINITE_HINT = "NaN and infinities are left out, by `nodata: auto`"
_SOURCES: dict[str, schema.FieldType[Any]] = {
    "file": schema.described(
        replace(SOURCE_FIELD, parser=_parse_file),
        "A file, a folder of slices, the URL of a store, or a list of steps in time; relative to the scene's file.",
        example="scan.nhdr",
    ),
    "raw": schema.described(
        schema.dataclass_field(RawSource, check_raw), "In place of `file`: voxels without a header."
    ),
    "procedural": schema.described(
        schema.dataclass_field(ProceduralSource), "In place of `file`: a volume that a formula makes."
    ),
}
# The keys of a volume of which exactly one is given.
SOURCES = schema.Alternatives([_SOURCES], [_SOURCES])
VOLUME_TABLE: schema.FieldTable = (
    _SOURCES
    | {
        "spacing": schema.described(
            SPACING_FIELD,
            "With `file`: the size of a voxel along x, y and z.",
            words="the file's, or 1",
            example="[0.1, 0.1, 0.5]",
        )
    }
    | schema.field_table(VolumeSpec)
)
VOLUME_SECTION = schema.section_field(
    VOLUME_TABLE,
    build_volume,
    misplaced_hints={"array": _ARRAY_HINT, "nonfinite": _NONFINITE_HINT},
    alternatives=SOURCES,
)
