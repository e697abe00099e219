"""The types of the fields of records, and the reading of records from plain data.

A record is a dataclass whose fields declare their types in annotations, as the sections of a scene do. JSON has
numbers, so text that spells a number is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from renderer.accuracy import MOST_DB
from renderer.errors import Problem
from renderer.scene import MAX_FRAMES, check_frames_ascend, is_plain_data, schema

# The largest number that a record may contain. No measured value comes near it, and sums over all parts of a film stay
# finite.
_MAX_AMOUNT = 1e100
# The largest whole number that a record may contain; it fits into 64 bits.
_MAX_COUNT = 2**63 - 1
# The largest number of nested levels in data that a record keeps unchecked. It is more than any scene or fingerprint
# has.
_MOST_LEVELS = 12
# The largest number of characters in a line of text of a record.
_MAX_LINE_LENGTH = 200
# The name of the field in which a record keeps the keys that other programs have added to its file.
FURTHER_KEYS = "further"

_DIGEST = re.compile("[0-9a-f]{32}")

T = TypeVar("T")


class _OfFrame(Protocol):
    """The interface of a record of one frame of a film."""

    @property
    def frame(self) -> int:
        """Return the number of the frame."""


OfFrame = TypeVar("OfFrame", bound=_OfFrame)


# Types of numbers and text


def number(expected: str, kinds: tuple[type, ...], least: float, most: float) -> schema.FieldType[Any]:
    """Return the type of a number from `least` to `most`. kinds: the Python types that the number may have."""

    def parse(node: schema.TreeNode) -> Any:
        value: Any = node.value
        if type(value) not in kinds:
            return node.reject("not a whole number" if kinds == (int,) else "not a number")
        return value if least <= value <= most else node.reject("out of range")

    return schema.FieldType(expected, parse)


def is_line(text: str) -> bool:
    """Return whether a text is one printable line, and neither empty nor long."""
    return text.isprintable() and 0 < len(text) <= _MAX_LINE_LENGTH


LINE_TEXT = f"one line of at most {_MAX_LINE_LENGTH} characters"
LINE = schema.text_field(LINE_TEXT, "not a line of text", is_line)
LINES = schema.mapping_field(LINE)
DIGEST = schema.text_field("32 hexadecimal digits", "not a digest", _DIGEST.fullmatch)
DIGESTS = schema.mapping_field(DIGEST)
TEXTS = schema.mapping_field(schema.TEXT_FIELD)
AMOUNT = number(f"a number from 0 to {_MAX_AMOUNT:g}", (int, float), 0, _MAX_AMOUNT)
AMOUNTS = schema.mapping_field(AMOUNT)
COORDINATE = number("a number", (int, float), -_MAX_AMOUNT, _MAX_AMOUNT)
DECIBELS = number(f"a number from -{MOST_DB:g} to {MOST_DB:g}", (int, float), -MOST_DB, MOST_DB)
COUNT = number("a whole number of at least 0", (int,), 0, _MAX_COUNT)
FRAME = number(f"a whole number from 0 to {MAX_FRAMES - 1}", (int,), 0, MAX_FRAMES - 1)
RANGE = schema.sequence_field(AMOUNT, "[smallest, largest]", count=2)
INTERVAL = schema.sequence_field(DECIBELS, "[low, high]", count=2)
SHARES = schema.sequence_field(AMOUNT, "a list of numbers", may_be_empty=True)
LEVELS = number("a number from -255 to 255", (int, float), -255, 255)
ERRORS = schema.sequence_field(LEVELS, "a list of numbers from -255 to 255")
PAIR = schema.sequence_field(COORDINATE, "[x, y]", count=2)
VECTOR = schema.sequence_field(COORDINATE, "[x, y, z]", count=3)
SHAPE = schema.sequence_field(COUNT, "[x, y, z]", count=3)
MATRIX = schema.sequence_field(schema.sequence_field(COORDINATE, "four numbers", count=4), "a 4 x 4 matrix", count=4)


# The type of data that is kept unchecked


def _parse_data(node: schema.TreeNode) -> Any:
    if not isinstance(node.value, dict) or is_plain_data(node.value, _MOST_LEVELS):
        return schema.MAPPING_FIELD.parse(node)
    return node.reject("too many levels", got="", expected=f"at most {_MOST_LEVELS}")


DATA: schema.FieldType[Any] = schema.FieldType("a mapping", _parse_data)


# Types of records


def read_record(field: schema.FieldType[T], value: object) -> T | None:
    """Return the record that a field type reads from plain data; None if the data is not a record of this type."""
    problems: list[Problem] = []
    record = field.read(schema.TreeNode(value, "", problems))
    return None if problems else record


def open_record(cls: Callable[..., T]) -> schema.FieldType[T]:
    """Return the type of a record to which other programs may add keys, which its field `further` keeps."""
    known = schema.dataclass_field(cls)
    names = schema.field_table(cls)

    def parse(node: schema.TreeNode) -> Any:
        if not isinstance(node.value, dict):
            return node.reject("not a mapping")
        further = DATA.parse(replace(node, value={key: node.value[key] for key in node.value if key not in names}))
        if further is schema.INVALID:
            return further
        record: Any = known.read(replace(node, value={key: node.value[key] for key in node.value if key in names}))
        return replace(record, **{FURTHER_KEYS: further})

    return schema.FieldType("a mapping", parse)


def frames(frame: schema.FieldType[OfFrame], expected: str) -> schema.FieldType[tuple[OfFrame, ...]]:
    """Return the type of a list of one or more records of frames, in the order of their numbers.

    Only the first wrong record is reported, as other records may have the same mistake.
    """

    def parse(node: schema.TreeNode) -> Any:
        if not isinstance(node.value, list):
            return node.reject("not a list")
        if not node.value:
            return node.reject("empty", got="")
        found: list[OfFrame] = []
        for index, value in enumerate(node.value):
            child, num_problems = node.child(index, value), len(node.problems)
            record = frame.read(child)
            if len(node.problems) > num_problems:
                return schema.INVALID
            if found and not check_frames_ascend(child.child("frame"), found[-1].frame, record.frame):
                return schema.INVALID
            found.append(record)
        return tuple(found)

    return schema.FieldType(expected, parse)
