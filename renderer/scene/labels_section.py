"""The scene's `labels` and `mask`: which labels of a segmentation are shown, their colours and names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from renderer.scene import schema
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.schema import INVALID, Color, TreeNode
from renderer.scene.volume_files import file_field
from renderer.scene.volume_section import (
    SOURCES,
    TRANSFORM_FIELD,
    VOLUME_TABLE,
    WITHOUT_TRANSFER,
    VolumeSpec,
    build_volume,
)

# The number or the name of a label.
LabelKey = int | str
# The largest number of labels that a mapping of a scene, or a table of labels, may have.
MAX_LABELS = 2**16
# The largest number of a label. Labels of connectomes, which are maps of neurons, have 60 bits.
MAX_LABEL = 2**63 - 1
# The largest number of characters in a label's name; a longer name is cut.
_MAX_NAME_LENGTH = 200


class LabelStyle(NamedTuple):
    """A label that is shown: its value in the volume, its name, its colour and its opacity."""

    value: int
    name: str
    color: Color
    opacity: float


@dataclass(frozen=True)
class LabelsSpec:
    """A choice of the labels that are shown, with their colours, opacities and names.

    colors: `auto` for colours that differ as much as possible, `table` for the colours in the volume's table of labels,
        or pairs of a label and a colour. A label without a pair has its colour in the table or, without a table, a
        colour as with `auto`. None is the same as no pairs.
    opacity: one opacity for all labels, or pairs of a label and an opacity; labels without a pair are opaque. None for
        the opacities in the table.
    show: the labels that are shown; None for all but 0. hide: labels that are not shown, even if `show` has them.
    names: the file of a table of labels, or pairs of a number and a name; None for the table in the volume's file, or
        beside it.
    """

    colors: Literal["auto", "table"] | tuple[tuple[LabelKey, Color], ...] | None = None
    opacity: float | tuple[tuple[LabelKey, float], ...] | None = None
    show: tuple[LabelKey, ...] | None = None
    hide: tuple[LabelKey, ...] = ()
    names: Path | tuple[tuple[int, str], ...] | None = None

    @property
    def has_numbers(self) -> bool:
        """Return whether the numbers of all labels that are shown are known before the volume is read."""
        is_listed = self.show is not None and not self.hide and not isinstance(self.names, Path)
        return is_listed and all(isinstance(label, int) for label in self.show or ())

    @property
    def has_colors(self) -> bool:
        """Return whether numbers, colours and opacities of the labels shown are known before the volume is read."""
        colors = dict(self.colors) if isinstance(self.colors, tuple) else {}
        is_complete = self.has_numbers and self.opacity is not None
        return is_complete and all(label in colors for label in self.show or ())

    @property
    def values(self) -> tuple[int, ...]:
        """Return the numbers of the labels that are shown, ascending. It may be called only if `has_numbers`."""
        assert self.has_numbers
        return tuple(sorted({label for label in self.show or () if isinstance(label, int)}))

    def written(self) -> dict[str, object]:
        """Return the section as a scene file has it: its keys with their values."""
        by_label = {
            key: dict(value) if isinstance(value, tuple) else value
            for key, value in vars(self).items()
            if key in ("colors", "opacity", "names")
        }
        return vars(self) | by_label | {"show": self.show or None, "hide": self.hide or None}

    @property
    def styles(self) -> tuple[LabelStyle, ...]:
        """Return the labels that are shown, ascending by number. It may be called only if `has_colors`."""
        assert self.has_colors and isinstance(self.colors, tuple)
        colors, names = dict(self.colors), dict(self.names) if isinstance(self.names, tuple) else {}
        opacities: dict[Any, float] = dict(self.opacity) if isinstance(self.opacity, tuple) else {}
        default = self.opacity if isinstance(self.opacity, float) else 1.0
        return tuple(
            LabelStyle(each, names.get(each, ""), colors[each], opacities.get(each, default)) for each in self.values
        )


def _parse_label(node: TreeNode) -> Any:
    """Return the number or the name of a label. Digits in a text are a number, as keys of JSON are always text."""
    if isinstance(node.value, str):
        digits = node.value.strip().removeprefix("-")
        is_number = digits.isdecimal() and digits.isascii() and len(digits) < 20
        found = int(node.value) if is_number else node.value.strip()[:_MAX_NAME_LENGTH]
        return node.reject("not a label") if found == "" else found
    number = schema.parse_whole_number(node.value)
    return number if number is not None and abs(number) <= MAX_LABEL else node.reject("not a label")


_LABEL = schema.FieldType(
    "the number or the name of a label", _parse_label, plain_schema=lambda _moves: {"type": ["integer", "string"]}
)


def _by_label(
    item: schema.FieldType[Any], expected: str, other: schema.FieldType[Any] | None = None
) -> schema.FieldType[Any]:
    """Return the field type of pairs (label, item), which a scene gives as a mapping from labels to items.

    other: the field type of values that are no mappings; None if only mappings are allowed.
    """

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, Mapping):
            return node.reject("not a mapping") if other is None else other.parser(node)
        if not 0 < len(node.value) <= MAX_LABELS:
            return node.reject("wrong number of labels", got=str(len(node.value)), expected=f"1 to {MAX_LABELS}")
        pairs: dict[Any, Any] = {}
        for key, value in node.value.items():
            label = _LABEL.read(node.key(key, key))
            if label in pairs and label is not INVALID:
                node.key(key, key).reject("a label twice", expected="each label once")
            pairs[label] = item.read(node.child(key, value))
        return INVALID if INVALID in pairs or INVALID in pairs.values() else tuple(pairs.items())

    def shape(moves: bool) -> schema.JsonSchema:
        by_label = {"type": "object", "minProperties": 1, "additionalProperties": item.schema(moves)}
        return by_label if other is None else schema.any_of(other.plain_schema(moves), by_label)

    return schema.FieldType(expected, parse, plain_schema=shape)


_PART = schema.number_field(minimum=0, maximum=1)
_COLORS = _by_label(COLOR_FIELD, "auto, table, or a mapping from labels to colors")
_NAMES = "the file of a table of labels, or a mapping from numbers to names"
_LABELS = schema.sequence_field(_LABEL, "a list of labels, by number or by name")
_CHOICE: schema.FieldTable = {
    "show": schema.described(
        _LABELS, "The labels that are shown, by number or by name.", words="all but 0", example="[3, thalamus]"
    ),
    "hide": schema.described(_LABELS, "Labels that are not shown.", words="none", example="[7]"),
    "names": schema.described(
        _by_label(schema.text_field("a name", "no name", str.strip), _NAMES, file_field(_NAMES, folder=False)),
        "The file of a table of labels, or names, such as {3: putamen}.",
        words="the one in or beside the volume's file",
        example="labels.ctbl",
    ),
}
LABELS_TABLE: schema.FieldTable = {
    "colors": schema.described(
        schema.word_or({"auto": "auto", "table": "table"}, _COLORS, _COLORS.expected),
        "The colors of labels. `auto`: as different as possible. `table`: from the table of labels.",
        words="from a table, else auto",
        example='{3: red, thalamus: "#3cb371"}',
    ),
    "opacity": schema.described(
        _by_label(_PART, "a number from 0 to 1, or a mapping from labels to such numbers", _PART),
        "The opacity of all labels, or by label, such as {3: 0.2}.",
        words="from a table, else 1",
        example="1",
    ),
    **_CHOICE,
}


def build_labels(node: TreeNode, given: dict[str, Any]) -> LabelsSpec:
    """Return the choice of labels that a section `labels` makes. given: the section's values, by their keys."""
    names = given.get("names")
    if isinstance(names, tuple):
        for value, _ in names:
            if not isinstance(value, int):
                node.child("names").key(value, value).reject("not the number of a label", expected="a whole number")
    return LabelsSpec(**given)


@dataclass(frozen=True)
class MaskSpec:
    """A mask of a layer: a volume of labels, on a grid of its own. The layer is shown only inside of the given labels.

    volume: the volume of labels; or the name of another layer, whose volume takes its place when all layers are read.
    labels: the labels in which the layer is shown.
    transform: a 4 x 4 matrix, row by row, that moves the volume of labels in the world.
    """

    volume: VolumeSpec | str
    labels: LabelsSpec = LabelsSpec()
    transform: tuple[tuple[float, ...], ...] | None = None

    def written(self) -> dict[str, object]:
        """Return the keys of the section with their values: the volume's keys or name, and the labels' keys."""
        volume = {"name": self.volume} if isinstance(self.volume, str) else self.volume.written()
        labels = {key: value for key, value in self.labels.written().items() if key != "colors"}
        return volume | labels | {"transform": self.transform}


_MASK_NAME = schema.text_field("the name of a volume in the list", "no name", str.strip)


def _build_mask(node: TreeNode, given: dict[str, Any]) -> Any:
    labels = build_labels(node, {key: given.pop(key) for key in _CHOICE if key in given})
    transform = given.pop("transform", None)
    if given.get("component") in WITHOUT_TRANSFER:
        node.key("component").reject("no component of labels", expected="a whole number")
    if given.get("interpolate") is True:
        node.key("interpolate").reject("contradicts mask", hint="there is nothing between two labels")
    if "name" not in given:
        if not given.keys() & {"file", "raw", "procedural"}:
            return node.reject("no voxels", got="", expected="one of file, raw, procedural and name")
        return MaskSpec(build_volume(node, given), labels, transform)
    name = given.pop("name")
    for key in schema.valid_keys({**given, "transform": transform or INVALID}, *given, "transform"):
        node.key(key).reject(f"contradicts {node.path}.name", expected="a name, or a volume of its own")
    return MaskSpec(name, labels)


_MASK_SOURCES = (*next(iter(SOURCES.one_of)), "name")
MASK_SECTION = schema.section_field(
    {
        **VOLUME_TABLE,
        **_CHOICE,
        "name": schema.described(
            _MASK_NAME, "The name of an entry of `volumes`, whose volume is the mask.", example="CT"
        ),
        "transform": TRANSFORM_FIELD,
    },
    _build_mask,
    alternatives=schema.Alternatives([_MASK_SOURCES], [_MASK_SOURCES]),
)
