"""Read headers of text, of which each line belongs to one field."""

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

# No header comes near this size, even with a file for each slice.
MAX_HEADER_BYTES = 2**22


@dataclass(frozen=True)
class Field:
    """A field: its text, and the place that messages name: the file, and its line where that is known."""

    name: str
    text: str
    where: str

    def error(self, expected: str, hint: str = "correct that line, or save the file again") -> InputError:
        """Return the error for a field whose text is not what belongs there."""
        return InputError(
            "a field of this header does not have what belongs there",
            where=self.where,
            got=f"{self.name}: {short_text(self.text)}" if self.text else f"{self.name} without a value",
            expected=expected,
            hint=hint,
        )

    def whole(self, least: int, most: float = math.inf) -> int:
        """Return the only number of the field; raises InputError unless it is a whole one from `least` to `most`."""
        return int(self.numbers(1, whole=True, least=least, most=most)[0])

    def numbers(
        self, count: int, *, whole: bool = False, least: float = -math.inf, most: float = math.inf
    ) -> list[float]:
        """Return the numbers of the field; raises InputError unless there are `count` of them, all finite.

        whole: whether only whole numbers belong there. least, most: the ends of what does.
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
    """Add a field to those of a header; raises InputError if it is there already. kind: of the header."""
    if key in fields:
        raise InputError(
            f"this {kind} header has a field twice",
            where=field.where,
            got=f"{short_text(fields[key].name)}, as in {fields[key].where}",
            hint="remove one of the lines",
        )
    fields[key] = field


def header_lines(path: Path) -> Iterator[tuple[str, str, int]]:
    """Yield the place of each line, its text, and the number of bytes up to its end; only of MAX_HEADER_BYTES.

    Text is decoded as file names are, whatever its bytes.
    """
    with path.open("rb") as file:
        head = file.read(MAX_HEADER_BYTES)
    end = 0
    for number, line in enumerate(io.BytesIO(head), 1):
        end += len(line)
        yield f"{path}:{number}", os.fsdecode(line.rstrip(b"\r\n")), end
