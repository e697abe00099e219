"""Float images to 8 bits: the only place where a picture loses precision, and it does so once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import RenderError
from renderer.scene import Color

_LARGEST = 255.0


def quantize(image: npt.NDArray[np.float32], background: Color | None) -> npt.NDArray[np.uint8]:
    """Composite over `background`, clip to [0, 1], scale to 255 and round half up.

    image: float32 [h, w, 4], premultiplied RGBA.
    background: the colour behind it, or None for a transparent picture.

    Returns uint8 [h, w, 3]; without a background [h, w, 4] with straight (not premultiplied) alpha, colour 0 where the
    alpha written is 0. A value that is not finite raises RenderError.
    """
    require_finite(image)
    return _over(image, background) if background is not None else _straight(image)


def _over(image: npt.NDArray[np.float32], background: Color) -> npt.NDArray[np.uint8]:
    """[h, w, 4] premultiplied over a colour: `c + (1 - a) b`."""
    result = np.empty((*image.shape[:2], 3), np.uint8)
    transparency = 1 - image[..., 3]
    # Channel by channel: numpy is several times slower along a last axis of three.
    for channel, behind in enumerate(background):
        result[..., channel] = _to_8_bits(image[..., channel] + transparency * np.float32(behind), _LARGEST)
    return result


def _straight(image: npt.NDArray[np.float32]) -> npt.NDArray[np.uint8]:
    """[h, w, 4] premultiplied to straight: `c / a`."""
    result = np.empty(image.shape, np.uint8)
    alpha = image[..., 3]
    result[..., 3] = _to_8_bits(alpha, _LARGEST)
    # No visible pixel has less alpha than half a step, so the bound changes none of them and saves the others from 0/0.
    scale = _LARGEST / np.maximum(alpha, np.float32(0.5 / _LARGEST))
    scale *= result[..., 3] > 0
    for channel in range(3):
        result[..., channel] = _to_8_bits(image[..., channel], scale)
    return result


def _to_8_bits(values: npt.NDArray[np.float32], scale: npt.NDArray[np.float32] | float) -> npt.NDArray[np.float32]:
    """`floor(values * scale + 1/2)` in [0, 255], the floor being left to the conversion to uint8 that follows."""
    scaled = values * scale
    scaled += 0.5
    return np.clip(scaled, 0, _LARGEST, out=scaled)


def require_finite(image: npt.NDArray[np.floating[Any]]) -> None:
    """Raise RenderError where a pixel of an image [h, w, channels] is not a number, naming the first one."""
    finite = np.isfinite(image)
    if finite.all():
        return
    bad = np.argwhere(~finite.all(axis=2))
    row, column = bad[0]
    raise RenderError(
        "the picture has pixels that are not numbers",
        got=f"{len(bad)} of {image.shape[0] * image.shape[1]} pixels, the first at row {row}, column {column}: "
        f"{image[row, column].tolist()}",
        hint="this is a fault of hsplat or of the graphics driver; please report it with the scene file",
    )
