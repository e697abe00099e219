"""Draw lines of text as masks, at whole pixels, with one font in any size.

Pillow's basic layout places glyphs from left to right, with hinting and kerning by FreeType. Scripts that join letters
or run from right to left would need a shaping library, which machines may lack.
"""

from __future__ import annotations

from functools import cache, lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.annotation.sketch import require_room
from renderer.errors import InputError
from renderer.scene import read_bounded, require_file
from renderer.system import printable
from renderer.volume import UInt8

# The largest size of the file of a font, in bytes.
MAX_FONT_BYTES = 2**25
# The font that comes with hsplat.
_OWN_FONT = Path(__file__).with_name("fonts") / "DejaVuSans.ttf"
# Letters that reach high above the baseline. Every line has room for these letters, so that lines of one size have one
# height.
_TALL = "Hdl"
# Letters that reach below the baseline. Every line has room for these letters.
_DEEP = "gpq"
# A code point that will never be a character, and for which no font has a glyph.
_NO_CHARACTER = "\U0010ffff"
# The largest number of characters of a line of text. Further characters are not drawn.
_LONGEST = 300
# The number of drawn lines that a font keeps, so that they are not drawn again.
_KEPT_LINES = 32


class Line(NamedTuple):
    """A drawn line of text: its mask, uint8 [h, w], and the row of the baseline in the mask."""

    mask: UInt8
    baseline: int


class Font:
    """A font, which draws lines of text in any size.

    line: a function that draws a line, as `_line` does, and keeps the last drawn lines.
    """

    def __init__(self, file: Path | None) -> None:
        """Read a font; without a file, the font that comes with hsplat. Raises InputError if it cannot be read."""
        file = file or _OWN_FONT
        require_file(file, "a font")
        self._file, self._content = file, read_bounded(file, MAX_FONT_BYTES, "a font")
        self._sized, self._has = cache(self._at_size), cache(self._has_glyph)
        self.line = lru_cache(_KEPT_LINES)(self._line)
        self.line(_TALL, 9)

    def _line(self, text: str, px: int) -> Line:
        """Return a drawn line of text. Unprintable characters are escaped.

        px: the size of the font (its em), in pixels. Raises InputError for characters that the font lacks, and for a
        file that is no font.
        """
        from PIL import Image, ImageDraw

        text = printable(text)[:_LONGEST]
        try:
            font = self._sized(px)
            if missing := "".join(sorted({each for each in text if not self._has(each)})):
                hint = "annotation.font: FILE has another font"
                raise InputError("the font lacks characters", got=missing, hint=hint)
            left, top, right, bottom = font.getbbox(text, anchor="ls")
            baseline = -min(top, font.getbbox(_TALL, anchor="ls")[1])
            height = baseline + max(bottom, font.getbbox(_DEEP, anchor="ls")[3])
            require_room(height, right - left)
            picture = Image.new("L", (max(right - left, 1), height))
            ImageDraw.Draw(picture).text((-left, baseline), text, 255, font, "ls")
        except (OSError, ValueError) as error:
            raise InputError("not a font", where=str(self._file), expected="TrueType or OpenType") from error
        return Line(np.array(picture), baseline)

    def _at_size(self, px: int) -> Any:
        from PIL import ImageFont

        return ImageFont.truetype(BytesIO(self._content), px, layout_engine=ImageFont.Layout.BASIC)

    def _has_glyph(self, character: str) -> bool:
        """Return whether the font has a glyph for a character."""
        glyph, none = (self._sized(32).getmask(each) for each in (character, _NO_CHARACTER))
        return character.isspace() or (glyph.size, bytes(glyph)) != (none.size, bytes(none))
