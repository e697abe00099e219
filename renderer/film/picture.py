"""A finished frame as pixels and as a PNG file, each made from the other on demand."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.film.atomic import translate_os_errors
from renderer.film.png import decode_png, encode_png

Pixels = npt.NDArray[np.uint8]


class Picture:
    """A read-only picture, made from its pixels or from a PNG file by `encode_png`.

    pixels: uint8 [h, w, 3], with a transparent background [h, w, 4] with straight alpha.
    png: the content of the file. file: where it is; read on demand.
    """

    def __init__(self, pixels: Pixels | None = None, *, png: bytes | None = None, file: Path | None = None) -> None:
        self._file = file
        if pixels is not None:
            self.__dict__["pixels"] = pixels
        if png is not None:
            self.__dict__["png"] = png

    @cached_property
    def pixels(self) -> Pixels:
        """Return the picture as an array. Raises InputError if the file is damaged."""
        try:
            return decode_png(self.png)
        except ValueError as error:
            hint = "remove it, and the command that drew it draws it again"
            raise InputError("a frame that cannot be decoded", where=str(self._file), hint=hint) from error

    @cached_property
    def png(self) -> bytes:
        """Return the content of the PNG file. Raises RenderError where it cannot be read."""
        if self._file is None:
            return encode_png(self.pixels)
        with translate_os_errors(self._file):
            return self._file.read_bytes()
