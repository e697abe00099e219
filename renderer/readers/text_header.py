"""Read text headers with a field on each line."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from renderer.errors import InputError
from renderer.scene import short_text
from renderer.system import number_in

# The largest length of a text header in bytes. No real header comes near it, even if it lists a file for each slice.
MAX_HEADER_BYTES = 2**22


@dataclass(frozen=True)
class Field:
    """A field of a header: its name, its text, and its place for messages: the file, and the line if it is known."""

    name: str
    text: str
    where: str

    def error(self, expected: str, hint: str = "correct that line, or save the file again") -> InputError:
        """Return the error for a field with an invalid value."""
        return InputError(
            "a field of this header has an invalid value",
            where=self.where,
            got=f"{self.name}: {short_text(self.text)}" if self.text else f"{self.name} without a value",
            expected=expected,
            hint=hint,
        )

    def whole(self, least: int, most: float = math.inf) -> int:
        """Return the only number of the field; raises InputError unless it is a whole number from `least` to `most`."""
        return int(self.numbers(1, whole=True, least=least, most=most)[0])

    def numbers(
        self, count: int, *, whole: bool = False, least: float = -math.inf, most: float = math.inf
    ) -> list[float]:
        """Return the numbers of the field; raises InputError unless there are `count` numbers, all finite.

        whole: whether only whole numbers are valid. least, most: the ends of the range of valid numbers.
        """
        words = self.text.split()
        numbers = [number_in(word) for word in words[: count + 1]]
        are_right = all(math.isfinite(x) and least <= x <= most and (x.is_integer() or not whole) for x in numbers)
        if len(numbers) != count or not are_right:
            kind = "whole number" if whole else "finite number"
            end = f" to {most:g}" if math.isfinite(most) else " on"
            ends = f" from {least:g}{end}" if math.isfinite(least) else ""
            raise self.error(f"a {kind}{ends}" if count == 1 else f"{count} {kind}s{ends}")
        return numbers


def add_field(fields: dict[str, Field], key: str, field: Field, kind: str) -> None:
    """Add a field to the fields of a header; raises InputError for a field that is there already.

    kind: the name of the format, for the message.
    """
    if key in fields:
        raise InputError(
            f"this {kind} header has a field twice",
            where=field.where,
            got=f"{short_text(fields[key].name)}, as in {fields[key].where}",
            hint="remove one of the lines",
        )
    fields[key] = field


def header_lines(path: Path) -> Iterator[tuple[str, str, int]]:
    """Yield the place of each line, its text, and the number of bytes up to its end, within MAX_HEADER_BYTES.

    Text is decoded like file names, so that any bytes are allowed.
    """
    with path.open("rb") as file:
        head = file.read(MAX_HEADER_BYTES)
    end = 0
    for number, line in enumerate(io.BytesIO(head), 1):
        end += len(line)
        yield f"{path}:{number}", os.fsdecode(line.rstrip(b"\r\n")), end
