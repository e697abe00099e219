"""Look-up tables of ImageJ, .lut: 256 colours as bytes, all red first, with a header or without; or rows of text."""

from __future__ import annotations

from typing import Any

from renderer.looks.curves import even_curve
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

_NUM_BYTES, _HEADER, _HEADER_BYTES = 768, b"ICOL", 32


def read(file: LookFile) -> Look:
    """Return the table in a file."""
    content = file.content[_HEADER_BYTES:] if file.content.startswith(_HEADER) else file.content
    if len(content) == _NUM_BYTES:
        rows: list[tuple[object, Any]] = [("the bytes", content[k::256]) for k in range(256)]
    else:
        rows = [(line, text.replace(",", " ").split()) for line, text in file.lines()]
        rows = rows[1:] if rows and rows[0][1][-1].isalpha() else rows  # a line of headings
    if not rows or any(len(row) not in (3, 4) for _, row in rows):
        raise file.error("not a look-up table", expected=f"{_NUM_BYTES} bytes, or rows of red, green and blue")
    return Look(even_curve([file.color(row[-3:], at, 255.0) for at, row in rows]), is_share=True)
