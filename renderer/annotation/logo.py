"""Read a logo, within bounds, and scale it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.scene import require_file
from renderer.volume import UInt8

_FORMATS = ("PNG", "JPEG", "WEBP")
MAX_LOGO_PIXELS = 64 * 2**20
_MAX_RATIO = 50


def read_logo(file: Path, height: int) -> UInt8:
    """Return a picture at this height: premultiplied RGBA, uint8 [h, w, 4]. Raises InputError."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # the size is checked below
    expected = "a picture: PNG, JPEG or WebP"
    require_file(file, expected)
    try:
        with Image.open(file, formats=_FORMATS) as picture:
            if picture.width * picture.height > MAX_LOGO_PIXELS or picture.width > _MAX_RATIO * picture.height:
                size = f"{picture.width} x {picture.height} pixels"
                raise InputError("too large for a logo", where=str(file), got=size, expected="at most 64 megapixels")
            width = max(round(height * picture.width / picture.height), 1)
            # Colours of transparent pixels do not count, and no weight is negative: nothing rings.
            scaled = picture.convert("RGBA").convert("RGBa").resize((width, height), Image.Resampling.HAMMING)
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError("this picture cannot be decoded", where=str(file), expected=expected) from error
    return np.array(scaled)
