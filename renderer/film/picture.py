"""A finished frame as pixels and as a PNG file, each made from the other on demand."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from renderer.film.png import decode_png, encode_png

Pixels = npt.NDArray[np.uint8]


class Picture:
    """A read-only picture, made from its pixels, its PNG file, or both.

    pixels: uint8 [h, w, 3], with a transparent background [h, w, 4] with straight alpha.
    png: the content of a PNG file from `encode_png`; other kinds are not read.
    """

    def __init__(self, pixels: Pixels | None = None, png: bytes | None = None) -> None:
        assert pixels is not None or png is not None
        if pixels is not None:
            self.__dict__["pixels"] = pixels
        if png is not None:
            self.__dict__["png"] = png

    @cached_property
    def pixels(self) -> Pixels:
        """The picture as an array. Raises ValueError if the file is damaged."""
        return decode_png(self.png)

    @cached_property
    def png(self) -> bytes:
        """The picture as a file."""
        return encode_png(self.pixels)
