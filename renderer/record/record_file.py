"""Read and write files of records: a JSON object each, whose keys are the fields of a dataclass.

Anybody may have edited a file: its size is checked before it is parsed, and reading reports every mistake with its
place, the value that was found, and the value that is expected.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from renderer.errors import InputError, Problem
from renderer.film import write_staged
from renderer.record.field_types import FURTHER_KEYS
from renderer.scene import (
    ErrorSpec,
    decode_utf8,
    format_value,
    load_json_object,
    may_be_json,
    raise_problems,
    read_bounded,
    read_json_object,
    require_file,
    schedule_to_dict,
    schema,
)

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

R = TypeVar("R", bound="DataclassInstance")

# The end of a JSON object that is written with one key on each line.
_END = "\n}"


@dataclass(frozen=True)
class RecordFile(Generic[R]):
    """A kind of file that holds one record.

    field: the type of the record. noun: the name of the kind, for messages. max_bytes: the largest size of a file.
    format_line: the value of the key `format`, which comes first in each file; None for a kind without this key.
    hint: the hint of the error about a file that has another format.
    lined: the last key of the record, if it has a list whose items each have a line of their own in the file.
    """

    field: schema.FieldType[R]
    noun: str
    max_bytes: int
    format_line: str | None = None
    hint: str | None = None
    lined: str | None = None

    def content(self, record: R) -> bytes:
        """Return the content of the file. Raises ValueError for numbers that JSON lacks (NaN, infinities)."""
        data = {"format": self.format_line} if self.format_line else {}
        data |= record_to_json(record)
        items = [_json_text(item) for item in data.pop(self.lined)] if self.lined else []
        text = _json_text(data, indent=2)
        if items:
            lines = ",\n    ".join(items)
            text = f'{text.removesuffix(_END)},\n  "{self.lined}": [\n    {lines}\n  ]{_END}'
        # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
        return f"{text}\n".encode(errors="backslashreplace")

    def write(self, path: Path, record: R, folder: Path | None = None) -> None:
        """Write the file, whole or not at all.

        folder: an existing folder for the temporary file; None for the folder of the path.
        Raises ValueError for numbers that JSON lacks, and InputError or RenderError if the file cannot be written.
        """
        write_staged(path, self.content(record), folder)

    def read(self, path: Path) -> R:
        """Return the record in a file. Raises InputError, or SceneError with all problems of the record."""
        require_file(path, self.noun)
        content = read_bounded(path, self.max_bytes, self.noun)
        return self.from_json(self.load(content, path) if may_be_json(content) else {}, path)

    def find(self, path: Path) -> R | None:
        """Return the record in a file; None if the file is missing or holds no JSON object.

        Raises InputError if the object has another format, or SceneError with all problems of the record.
        """
        data = read_json_object(path, self.max_bytes)
        return None if data is None else self.from_json(data, path)

    def load(self, content: bytes, path: Path) -> dict[str, Any]:
        """Return the data in the content of a file, which begins with a brace.

        Raises InputError if it is too large or no JSON, and SceneError with all values that records cannot have.
        """
        if len(content) > self.max_bytes:
            raise InputError(f"too large for {self.noun}", where=str(path), expected=f"at most {self.max_bytes} bytes")
        return load_json_object(decode_utf8(content, path), path, kind=self.noun)

    def from_json(self, data: Mapping[str, Any], path: Path) -> R:
        """Return the record in plain data of a file.

        Raises InputError where the data has another format, or SceneError with all problems of the record.
        """
        if self.format_line is not None and data.get("format") != self.format_line:
            raise InputError(
                f"{self.noun} of another version of hsplat",
                where=str(path),
                got=f"format {format_value(data['format'])}" if "format" in data else "no format",
                expected=f"format {self.format_line!r}",
                hint=self.hint,
            )
        keys = {key: value for key, value in data.items() if key != "format" or self.format_line is None}
        problems: list[Problem] = []
        record = schema.read_option(self.field, keys, str(path), problems, schema.FilmTime(None, 1.0))
        raise_problems(problems)
        return record


def record_to_json(record: DataclassInstance) -> dict[str, Any]:
    """Return a record as plain data for JSON. Fields that have their defaults are left out."""
    found: dict[str, Any] = {}
    for field in fields(record):
        value = getattr(record, field.name)
        if field.name == FURTHER_KEYS:
            found |= value
        elif field.default is MISSING or value != field.default:
            found[field.name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, ErrorSpec):
        return schedule_to_dict(value)
    if is_dataclass(value) and not isinstance(value, type):
        return record_to_json(value)
    return [_plain(item) for item in value] if isinstance(value, (tuple, list)) else value


def _json_text(data: Any, indent: int | None = None) -> str:
    return json.dumps(data, indent=indent, ensure_ascii=False, allow_nan=False)
