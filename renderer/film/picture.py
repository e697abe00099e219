"""Hold a finished frame as pixels and as a PNG or EXR file, and make each from the other on demand."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.film.atomic import translate_os_errors
from renderer.film.exr import EXR_BEGIN, decode_exr, encode_exr
from renderer.film.png import decode_png, encode_png, png_layout
from renderer.transfer import linear_of_srgb, srgb_of_linear

# The pixels of a picture, uint8, uint16 or float32, [h, w, 3] or [h, w, 4]. Alpha is straight for integers, and
# premultiplied for floats.
Pixels = npt.NDArray[Any]


class Picture:
    """A read-only picture, made from its pixels or from a file: EXR for floats, else PNG.

    Exactly one of the first three arguments is given. pixels: the pixels, as `quantize` returns them. content: the
    content of the file. file: the path of the file, which is read on demand. dpi: the resolution that a file made of
    pixels states, in pixels per inch.
    """

    def __init__(
        self,
        pixels: Pixels | None = None,
        *,
        content: bytes | None = None,
        file: Path | None = None,
        dpi: float | None = None,
    ) -> None:
        self._file, self._dpi = file, dpi
        if pixels is not None:
            self.__dict__["pixels"] = pixels
        if content is not None:
            self.__dict__["content"] = content

    @cached_property
    def pixels(self) -> Pixels:
        """Return the picture as an array. Raises InputError if the file is damaged."""
        try:
            return decode_exr(self.content) if self.content.startswith(EXR_BEGIN) else decode_png(self.content)
        except ValueError as error:
            hint = "remove it, and the command that drew it draws it again"
            raise InputError("a frame that cannot be decoded", where=str(self._file), hint=hint) from error

    @cached_property
    def content(self) -> bytes:
        """Return the picture as the content of a PNG or EXR file. Raises RenderError if its file cannot be read."""
        if self._file is None:
            encode = encode_exr if self.pixels.dtype == np.float32 else encode_png
            return encode(self.pixels, self._dpi)
        with translate_os_errors(self._file):
            return self._file.read_bytes()


def picture_layout(content: bytes) -> tuple[tuple[int, int, int], int]:
    """Return (height, width, channels) of the picture in a PNG or EXR file, and its bits a channel.

    content: the content of the file. Raises ValueError with the fault if the file is damaged.
    """
    if content.startswith(EXR_BEGIN):
        return decode_exr(content).shape, 32
    return png_layout(content)


def over_black(pixels: Pixels, *, is_linear: bool = False) -> npt.NDArray[np.float64]:
    """Return pixels as float64 in [0, 1], composited over black. Pixels with alpha keep it as the fourth channel.

    pixels: of any depth, [..., 3] or [..., 4]. is_linear: whether the picture was made from linear light: floats are
        linear light, and matter is composited in linear light. The result is encoded as sRGB.
    """
    values: npt.NDArray[np.float64]
    if pixels.dtype == np.float32:
        values = np.clip(pixels, 0.0, 1.0).astype(np.float64)
    else:
        values = pixels / np.float64(np.iinfo(pixels.dtype).max)
        if values.shape[-1] == 3:
            return values
        colors = linear_of_srgb(values[..., :3]) if is_linear else values[..., :3]
        values[..., :3] = colors * values[..., 3:]
    if is_linear:
        values[..., :3] = srgb_of_linear(values[..., :3])
    return values
