"""The scene's `annotation`: a title, a legend, a scale bar and other entries, drawn over finished pictures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from renderer.errors import InputError
from renderer.scene import schema
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.layers_section import LayerSpec
from renderer.scene.message_text import did_you_mean, join_some
from renderer.scene.schema import INVALID, Color, KeyText, TreeNode
from renderer.scene.volume_files import file_field
from renderer.system import printable

# The largest number of characters in a text of the annotation, such as its title.
MAX_TEXT_LENGTH = 200

Position = Literal["top-left", "top", "top-right", "left", "right", "bottom-left", "bottom", "bottom-right"]

# A placeholder, such as {camera.zoom} or {seconds:06.2f}: the name of a number, and the format of its digits.
_PLACEHOLDER = re.compile(r"\{([\w. -]+)(?::(0?[0-9]{0,2})(?:(d)|(\.[0-9]{1,2})?([feg%])?))?\}")
FRAME_NAMES = ("frame", "seconds", "time")
_FORMAT_WORDS = "text with names in braces, such as {seconds:.1f} s, of one line"


def _is_line(text: str) -> bool:
    return bool(text.strip()) and len(text) <= MAX_TEXT_LENGTH and printable(text) == text


_TEXT = schema.text_field(f"text of one line, 1 to {MAX_TEXT_LENGTH} characters", "not a line of text", _is_line)


def _parse_format(node: TreeNode) -> Any:
    if not isinstance(node.value, str) or not _is_line(node.value):
        return node.reject("not a line of text")
    rest = _PLACEHOLDER.sub("", node.value)
    if "{" in rest or "}" in rest:
        expected = "{name} or {name:.1f}, in which 5.1f, 04d, .2e, .3g and .0% are formats, and no other braces"
        return node.reject("not a valid format", expected=expected)
    return node.value


def fill_format(text: str, values: Mapping[str, float]) -> str:
    """Return a text with numbers in place of its placeholders. Raises InputError for a name without a value."""

    def number(found: re.Match[str]) -> str:
        name, width, whole, digits, kind = (part or "" for part in found.groups())
        if name not in values:
            raise InputError("no such number", got=f"{{{name}}}", expected=join_some(list(values)))
        value, rest = values[name], digits + kind
        if whole or (isinstance(value, int) and not rest):
            return format(round(value), f"{width}d")
        return format(value, width + (rest or "g"))

    return _PLACEHOLDER.sub(number, text)


_COLOR = schema.word_or({"auto": "auto"}, COLOR_FIELD, f"auto, or {COLOR_FIELD.expected}")
_SIZE = schema.number_field(minimum=0.005, maximum=0.5, motion=None)


@dataclass(frozen=True, kw_only=True)
class EntrySpec:
    """An entry of the annotation: a text, a bar or a picture that is drawn over finished pictures.

    position: the place in the picture. Entries at one position stack in the order of the keys, away from the edge.
    size: the height of the text, or of the whole logo or orientation, as a share of the picture's height; None is the
        size of the annotation's texts.
    color: `auto` is the color of the annotation.
    """

    position: Annotated[Position, KeyText("The place along the edges of the picture.")]
    size: Annotated[
        float | None,
        _SIZE,
        KeyText(
            "The height of the text, or of the whole entry, as a share of the picture's.", "that of all texts", "0.03"
        ),
    ] = None
    color: Annotated[
        Color | Literal["auto"], _COLOR, KeyText("The color of the entry; `auto`: that of all entries.")
    ] = "auto"


@dataclass(frozen=True, kw_only=True)
class ColorBarSpec(EntrySpec):
    """An entry that shows the colours and opacities of transfer functions.

    label: the text over the bar; by default the name and the unit of the scalar.
    length: the length of the bar, as a share of the picture's height.
    layer: the number, from 0, of the volume whose transfer function is shown; None shows those of all volumes.
    """

    label: Annotated[str | None, _TEXT, KeyText("The text over the bar.", "name and unit of the values", "density")] = (
        None
    )
    length: Annotated[
        float,
        schema.number_field(minimum=0.05, maximum=0.9, motion=None),
        KeyText("The length of the bar, as a share of the picture's height."),
    ] = 0.35
    layer: Annotated[
        int | None, schema.integer_field(minimum=0), KeyText("The number of the volume, from 0.", "all", "0")
    ] = None


@dataclass(frozen=True, kw_only=True)
class TimeSpec(EntrySpec):
    """An entry with a line of text that has numbers in it.

    format: the text, with names of numbers in braces: `frame`, `seconds` from the start of the film, `time` of the step
        that is shown, and dotted keys of values that move, such as `camera.zoom`.
    """

    format: Annotated[
        str,
        schema.FieldType(_FORMAT_WORDS, _parse_format, plain_schema=schema.of_json_type("string")),
        KeyText("The text, with `frame`, `seconds`, `time` or a key that moves in braces."),
    ] = "{seconds:.1f} s"


@dataclass(frozen=True, kw_only=True)
class TitleSpec(EntrySpec):
    """An entry with a fixed line of text."""

    text: Annotated[str, _TEXT, KeyText("The text of the title.", example="Abdomen")]


@dataclass(frozen=True, kw_only=True)
class LogoSpec(EntrySpec):
    """An entry with a picture from a PNG, JPEG or WebP file."""

    file: Annotated[
        Path,
        file_field("a picture: PNG, JPEG or WebP", folder=False),
        KeyText("The picture, relative to the scene's file.", example="institute.png"),
    ]


@dataclass(frozen=True, kw_only=True)
class NamesSpec:
    """The names of labels at the sides of the picture, with lines to their labels.

    size, color: as of an entry. Without a size, names are smaller than texts if they do not fit otherwise.
    """

    size: Annotated[
        float | None,
        _SIZE,
        KeyText("The height of names, as a share of the picture's.", "that of all texts, or less", "0.03"),
    ] = None
    color: Annotated[Color | Literal["auto"], _COLOR, KeyText("The color of names; `auto`: that of all entries.")] = (
        "auto"
    )


def _parse_names(node: TreeNode) -> Any:
    if isinstance(node.value, bool):
        return NamesSpec() if node.value else None
    return _NAMES_SECTION.parser(node) if isinstance(node.value, Mapping) else node.reject("neither true nor a mapping")


_NAMES_SECTION = schema.dataclass_field(NamesSpec)
_NAMES = schema.FieldType[Any](
    "true, or a mapping",
    _parse_names,
    table=_NAMES_SECTION.table,
    plain_schema=schema.either(_NAMES_SECTION, schema.BOOLEAN_FIELD),
    example="true",
)


def _entry(cls: Any, position: Position, size: float | None = None, short: str | None = None) -> schema.FieldType[Any]:
    """Return the field type of an entry of class `cls`.

    A scene gives the entry as a mapping, as the value of its key `short` alone or, if no key is required, as true.
    position, size: the default values of these keys.
    """
    defaults: dict[str, Any] = {"position": position, "size": size}
    table = schema.field_table(cls)
    for key, value in defaults.items():
        text = table[key].text
        if value is not None and text is not None:
            table[key] = replace(table[key], default=value, text=replace(text, default=""))
    required = [key for key in schema.required_keys(cls) if key not in defaults]
    section = schema.section_field(table, lambda _, given: cls(**defaults | given), required=required)

    def parse(node: TreeNode) -> Any:
        if isinstance(node.value, Mapping):
            return section.parse(node)
        if isinstance(node.value, bool) and not required:
            return cls(**defaults) if node.value else None
        if short is None:
            return node.reject("neither true nor a mapping")
        value = table[short].parser(node)
        return value if value is INVALID else cls(**defaults, **{short: value})

    words = ["" if required else "true", table[short].expected if short else "", "a mapping"]
    forms = [section, *([table[short]] if short else []), *([] if required else [schema.BOOLEAN_FIELD])]
    return schema.FieldType(
        ", or ".join(filter(None, words)),
        parse,
        table=section.table,
        plain_schema=schema.either(*forms),
        example=schema.example_of(table[short]) if required and short else "true",
    )


@dataclass(frozen=True)
class AnnotationSpec:
    """A list of entries, which are drawn over finished pictures in this order.

    bounds: whether to draw lines around the volume, with ticks. octree: whether to draw the edges of cells.
    font: the file of the font of all texts; None is DejaVu Sans.
    layout: `beside` frames the object into the room that entries leave; `over` puts entries over the picture.
    color: the color of entries whose own color is `auto`. `auto` is white on a dark background, and black on a light or
        transparent one.
    names: the names of labels beside the object, with lines to them; None for none.
    size: the height of texts whose entries have no size of their own, as a share of the picture's height.
    """

    title: Annotated[TitleSpec | None, _entry(TitleSpec, "top", short="text"), KeyText("A line of text.", "none")] = (
        None
    )
    logo: Annotated[
        LogoSpec | None, _entry(LogoSpec, "top-left", 0.12, short="file"), KeyText("A picture from a file.", "none")
    ] = None
    time: Annotated[
        TimeSpec | None, _entry(TimeSpec, "top-right", short="format"), KeyText("A line with numbers in it.", "none")
    ] = None
    legend: Annotated[
        EntrySpec | None, _entry(EntrySpec, "left"), KeyText("Names and colors of labels, or of volumes.", "none")
    ] = None
    color_bar: Annotated[
        ColorBarSpec | None,
        _entry(ColorBarSpec, "right"),
        KeyText("The colors and opacities of a transfer function.", "none"),
    ] = None
    scale_bar: Annotated[
        EntrySpec | None,
        _entry(EntrySpec, "bottom-left"),
        KeyText(
            "A bar of a round length, at the distance of the camera's target. With `projection: orthographic` it holds "
            "everywhere.",
            "none",
        ),
    ] = None
    accuracy: Annotated[
        EntrySpec | None, _entry(EntrySpec, "bottom-left"), KeyText("The accuracy of the frame.", "none")
    ] = None
    orientation: Annotated[
        EntrySpec | None,
        _entry(EntrySpec, "bottom-right", 0.12),
        KeyText("Arrows along the axes of the world.", "none"),
    ] = None
    bounds: Annotated[bool, KeyText("Whether the volume's box is drawn, with ticks.")] = False
    octree: Annotated[bool, KeyText("Whether the edges of cells are drawn, colored by size.")] = False
    font: Annotated[
        Path | None,
        file_field("the file of a font: TrueType or OpenType", folder=False),
        KeyText("The file of the font of all texts.", "DejaVu Sans", "NotoSansCJK-Regular.otf"),
    ] = None

    layout: Annotated[
        Literal["beside", "over"],
        KeyText("`beside`: the object has the room that entries leave. `over`: entries are over it."),
    ] = "beside"
    color: Annotated[
        Color | Literal["auto"],
        _COLOR,
        KeyText("The color of all entries; `auto`: dark before a light or transparent background, else light."),
    ] = "auto"
    size: Annotated[float, _SIZE, KeyText("The height of all texts, as a share of the picture's.")] = 0.03
    names: Annotated[
        NamesSpec | None, _NAMES, KeyText("The names of labels beside the object, with lines to them.", "none")
    ] = None

    def written(self) -> object:
        """Return the section as a scene file has it: its keys. Defaults of keys that all entries share are left out."""
        defaults = {"layout": "beside", "color": "auto", "size": 0.03}
        return {key: value for key, value in vars(self).items() if defaults.get(key) != value}

    @property
    def entries(self) -> dict[str, EntrySpec]:
        """Return the entries that have a position, by key."""
        values = ((each.name, getattr(self, each.name)) for each in fields(self))
        return {key: value for key, value in values if isinstance(value, EntrySpec)}

    def size_of(self, key: str) -> float:
        """Return the size of an entry: its own, or the size of all texts. key: the key of the entry."""
        size = self.entries[key].size
        return self.size if size is None else size

    @property
    def shows_anything(self) -> bool:
        """Return whether the annotation draws anything."""
        return self.has_patches or self.bounds or self.octree

    @property
    def has_patches(self) -> bool:
        """Return whether the annotation draws anything but lines in the volume."""
        return bool(self.entries) or self.names is not None

    @property
    def name_sides(self) -> tuple[Literal["left", "right"], ...]:
        """Return the sides of the picture where names have room, as no entry is in the middle of the side."""
        taken = {entry.position for entry in self.entries.values()}
        sides: tuple[Literal["left", "right"], ...] = ("left", "right")
        return tuple(side for side in sides if side not in taken)

    @property
    def files(self) -> list[Path]:
        """Return the files that the annotation names: the font and the logo, as far as they are given."""
        return [file for file in (self.font, self.logo.file if self.logo else None) if file is not None]


ANNOTATION_SECTION = schema.dataclass_field(AnnotationSpec)


def check_annotation(
    node: TreeNode, annotation: AnnotationSpec, layers: Sequence[LayerSpec], moving: Mapping[str, object]
) -> None:
    """Check that the scene has what the annotation names: labels, values, a volume, and numbers that move.

    node: the node of the annotation. moving: the scene's moving values at some frame, by their keys.
    """
    _check_names(node, annotation, layers)
    bar, time = annotation.color_bar, annotation.time
    if bar is not None and bar.layer is not None and bar.layer >= len(layers):
        expected = f"a number from 0 to {len(layers) - 1}"
        node.child("color_bar").child("layer", bar.layer).reject("no such volume", expected=expected)
    if time is None:
        return
    known, place = [*FRAME_NAMES, *moving_numbers(moving)], node.child("time")
    if isinstance(node.value, Mapping) and isinstance(node.value["time"], Mapping):
        place = place.child("format")
    for name in (found[1] for found in _PLACEHOLDER.finditer(time.format)):
        if name not in known:
            hint = did_you_mean(name, known)
            place.reject("nothing of this name moves", got=f"{{{name}}}", expected=join_some(known), hint=hint)


def _check_names(node: TreeNode, annotation: AnnotationSpec, layers: Sequence[LayerSpec]) -> None:
    """Check that there are names for names and legends, and values for color bars."""
    are_labels = [layer.transfer_function.labels is not None for layer in layers]
    if annotation.names is not None and not any(are_labels):
        hint = "`labels` in place of `transfer_function` draws the labels of a segmentation"
        node.child("names").reject("no labels to name", got="", expected="a scene with labels", hint=hint)
    may_have_legend = len(layers) > 1 or are_labels[0] or layers[0].volume.component == "all"
    if annotation.legend is not None and not may_have_legend:
        hint = "color_bar shows the colors of values"
        node.child("legend").reject("nothing has a name", got="", expected="labels, or several volumes", hint=hint)
    if annotation.color_bar is not None and all(are_labels):
        hint = "legend or names shows the names of labels"
        node.child("color_bar").reject("no values to show", got="", expected="a transfer function", hint=hint)


def moving_numbers(moving: Mapping[str, object]) -> dict[str, float]:
    """Return those of the moving values that are numbers, by their keys."""
    return {key: value for key, value in moving.items() if isinstance(value, (int, float))}
