"""Put float images over their background, and round them to 8 bits: the only place where a picture loses precision."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import RenderError
from renderer.kernels import kernels
from renderer.scene import Color

_BLACK = (0.0, 0.0, 0.0)


def quantize(image: npt.NDArray[np.float32], background: Color | None) -> npt.NDArray[np.uint8]:
    """Composite over `background`, clip to [0, 1], scale to 255 and round half up.

    image: float32 [h, w, 4], premultiplied RGBA.
    background: the colour behind it, or None for a transparent picture.

    Returns uint8 [h, w, 3]; without a background [h, w, 4] with straight (not premultiplied) alpha, and colour 0 where
    the rounded alpha is 0. Raises RenderError for a value that is not finite.
    """
    require_finite(image)
    result = np.empty((*image.shape[:2], 4 if background is None else 3), np.uint8)
    kernels().quantize(image=np.ascontiguousarray(image), background=background or _BLACK, result=result)
    return result


def over_background(radiance: npt.NDArray[np.floating[Any]], background: Color | None) -> npt.NDArray[np.float64]:
    """Return the picture before it is rounded, which metrics compare: `c + (1 - a) b`, clipped to [0, 1].

    radiance: [h, w, 4], premultiplied RGBA. background: None, for a transparent film, counts as black.

    Returns float64 [h, w, 3]. Raises RenderError for a value that is not finite.
    """
    require_finite(radiance)
    picture = np.empty((*radiance.shape[:2], 3))
    transparency = 1 - radiance[..., 3].astype(np.float64)
    for channel, behind in enumerate(background or _BLACK):
        picture[..., channel] = radiance[..., channel] + transparency * behind
    return np.clip(picture, 0, 1, out=picture)


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
