"""Put float images over their background, and round them to 8 bits: the only place where a picture loses precision."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.compiled import jit
from renderer.errors import RenderError
from renderer.scene import Color

# In float32, because numba continues in float64 after a Python number.
_ZERO, _HALF, _ONE, _LARGEST = (np.float32(value) for value in (0.0, 0.5, 1.0, 255.0))


def quantize(image: npt.NDArray[np.float32], background: Color | None) -> npt.NDArray[np.uint8]:
    """Composite over `background`, clip to [0, 1], scale to 255 and round half up.

    image: float32 [h, w, 4], premultiplied RGBA.
    background: the colour behind it, or None for a transparent picture.

    Returns uint8 [h, w, 3]; without a background [h, w, 4] with straight (not premultiplied) alpha, and colour 0 where
    the rounded alpha is 0. Raises RenderError for a value that is not finite.
    """
    require_finite(image)
    result = np.empty((*image.shape[:2], 4 if background is None else 3), np.uint8)
    if background is None:
        _unpremultiply(image, result)
    else:
        _composite_over(np.ascontiguousarray(image), np.array(background, np.float32), result)
    return result


def over_background(radiance: npt.NDArray[np.floating[Any]], background: Color | None) -> npt.NDArray[np.float64]:
    """Return the picture before it is rounded, which metrics compare: `c + (1 - a) b`, clipped to [0, 1].

    radiance: [h, w, 4], premultiplied RGBA. background: None, for a transparent film, counts as black.

    Returns float64 [h, w, 3]. Raises RenderError for a value that is not finite.
    """
    require_finite(radiance)
    picture = np.empty((*radiance.shape[:2], 3))
    transparency = 1 - radiance[..., 3].astype(np.float64)
    for channel, behind in enumerate(background or (0.0, 0.0, 0.0)):
        picture[..., channel] = radiance[..., channel] + transparency * behind
    return np.clip(picture, 0, 1, out=picture)


@jit
def _composite_over(
    image: npt.NDArray[np.float32], background: npt.NDArray[np.float32], result: npt.NDArray[np.uint8]
) -> None:
    """Composite [h, w, 4], premultiplied, over a colour: `c + (1 - a) b`. Only a flat loop compiles to vectors."""
    pixels, values = image.reshape(-1), result.reshape(-1)
    red, green, blue = background[0], background[1], background[2]
    for k in range(values.size // 3):
        transparency = _ONE - pixels[4 * k + 3]
        values[3 * k] = _to_8_bits((pixels[4 * k] + transparency * red) * _LARGEST)
        values[3 * k + 1] = _to_8_bits((pixels[4 * k + 1] + transparency * green) * _LARGEST)
        values[3 * k + 2] = _to_8_bits((pixels[4 * k + 2] + transparency * blue) * _LARGEST)


@jit
def _unpremultiply(image: npt.NDArray[np.float32], result: npt.NDArray[np.uint8]) -> None:
    """Convert [h, w, 4] from premultiplied to straight alpha: `c / a`."""
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            alpha = image[row, column, 3]
            result[row, column, 3] = _to_8_bits(alpha * _LARGEST)
            for channel in range(3):
                is_seen = result[row, column, 3] > 0
                value = image[row, column, channel] * (_LARGEST / alpha) if is_seen else _ZERO
                result[row, column, channel] = _to_8_bits(value)


@jit
def _to_8_bits(scaled: np.float32) -> Any:
    """Return `floor(scaled + 1/2)` in [0, 255]; the conversion takes the floor."""
    return np.uint8(min(max(scaled + _HALF, _ZERO), _LARGEST))


def require_finite(image: npt.NDArray[np.floating[Any]]) -> None:
    """Raise RenderError, naming the first bad pixel, if an image [h, w, channels] has values that are not finite."""
    finite = np.isfinite(image)
    if finite.all():
        return
    bad = np.argwhere(~finite.all(axis=2))
    row, column = bad[0]
    raise RenderError(
        "the picture has pixels that are not finite numbers",
        got=f"{len(bad)} of {image.shape[0] * image.shape[1]} pixels, the first at row {row}, column {column}: "
        f"{image[row, column].tolist()}",
        hint="this is a bug in hsplat or in the graphics driver; please report it with the scene file",
    )
