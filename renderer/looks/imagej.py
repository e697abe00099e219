"""Look-up tables of ImageJ, .lut: colours as bytes, all red first, 256 or as many as a header says; or rows of text."""

from __future__ import annotations

from renderer.looks.color_tables import even_look
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

_HEADER, _HEADER_BYTES, _NUM_COLORS = b"ICOL", 32, 256
# 256 colours alone, and what some programs append to them.
_RAW_SIZES = (768, 970)


def read(file: LookFile) -> Look:
    """Return the table in a file."""
    content, has_header = file.content, file.content.startswith(_HEADER)
    if has_header or len(content) in _RAW_SIZES:
        num = int.from_bytes(content[6:8], "big") * has_header or _NUM_COLORS
        planes = content[_HEADER_BYTES if has_header else 0 :]
        # ImageJ stretches fewer colours so that they begin at even distances.
        last = num * (_NUM_COLORS - 1) / _NUM_COLORS
        return even_look(file, [("the bytes", *planes[k : 3 * num : num]) for k in range(num)], 255.0, last)
    rows = [(line, text.replace(",", " ").split()) for line, text in file.lines()]
    rows = rows[1:] if rows and rows[0][1][-1].isalpha() else rows  # a line of headings
    has_index = bool(rows) and len(rows[0][1]) == 4
    return even_look(file, [(line, *row[has_index:]) for line, row in rows], 255.0)
