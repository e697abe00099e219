"""A finished frame: its pixels, the PNG file that holds them, or both, each made from the other when it is needed."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from renderer.film.png import decode_png, encode_png

Pixels = npt.NDArray[np.uint8]


class Picture:
    """Made with one of the two, or with both. Not to be changed.

    pixels: uint8 [h, w, 3], with a transparent background [h, w, 4] with straight alpha.
    png: a PNG file's content, as `renderer.film.png` makes it; others are not read.
    """

    def __init__(self, pixels: Pixels | None = None, png: bytes | None = None) -> None:
        assert pixels is not None or png is not None
        if pixels is not None:
            self.__dict__["pixels"] = pixels
        if png is not None:
            self.__dict__["png"] = png

    @cached_property
    def pixels(self) -> Pixels:
        """The picture as an array. Raises ValueError where the file is not whole."""
        return decode_png(self.png)

    @cached_property
    def png(self) -> bytes:
        """The picture as a file."""
        return encode_png(self.pixels)
