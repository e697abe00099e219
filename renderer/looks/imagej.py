"""Import look-up tables of ImageJ, .lut: colours as bytes, or rows of text.

The bytes are all red values, then all green and all blue ones: 256 each, or the number in a header.
"""

from __future__ import annotations

from renderer.looks.color_tables import even_look
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

# The first bytes of a look-up table that has a header.
_HEADER = b"ICOL"
# The length of the header of a look-up table, in bytes.
_HEADER_BYTES = 32
# The number of colours of a look-up table without a header.
_NUM_COLORS = 256
# The sizes in bytes of a file with 256 colours and no header. Some programs append 202 bytes to the colours.
_RAW_SIZES = (768, 970)


def read(file: LookFile) -> Look:
    """Return the look-up table in a file, as a look."""
    content, has_header = file.content, file.content.startswith(_HEADER)
    if has_header or len(content) in _RAW_SIZES:
        num = int.from_bytes(content[6:8], "big") * has_header or _NUM_COLORS
        planes = content[_HEADER_BYTES if has_header else 0 :]
        # ImageJ divides the range into equal parts, one for each colour, so that the last colour begins before the end.
        last = num * (_NUM_COLORS - 1) / _NUM_COLORS
        return even_look(file, [("the bytes", *planes[k : 3 * num : num]) for k in range(num)], 255.0, last)
    rows = [(line, text.replace(",", " ").split()) for line, text in file.lines()]
    rows = rows[1:] if rows and rows[0][1][-1].isalpha() else rows  # the first line may be a heading
    has_index = bool(rows) and len(rows[0][1]) == 4
    return even_look(file, [(line, *row[has_index:]) for line, row in rows], 255.0)
