"""Composite float images over their background, and round them: the only place where a picture loses precision."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import RenderError
from renderer.film.picture import Pixels
from renderer.kernels import kernels
from renderer.scene import Background
from renderer.transfer import linear_of_srgb, srgb_of_linear

_BLACK = (0.0, 0.0, 0.0)


def quantize(
    image: npt.NDArray[np.float32], background: Background, depth: int = 8, *, is_linear: bool = False
) -> Pixels:
    """Return an image composited over `background`, clipped to [0, 1], scaled to 255 or 65535, and rounded half up.

    image: float32 [h, w, 4], premultiplied RGBA.
    background: the colours behind the image, or None for a transparent picture.
    depth: the bits of a channel: 8 or 16 for whole numbers, 32 for floats.
    is_linear: whether the image is linear light. It is composited as such, and then encoded as sRGB; floats stay linear
        light.
    Returns uint8 or uint16 [h, w, 3]; without a background [h, w, 4] with straight (not premultiplied) alpha, and
    colour 0 where the rounded alpha is 0. For a depth of 32, returns float32, neither clipped nor rounded, with
    premultiplied alpha. Raises RenderError for a value that is not finite.
    """
    require_finite(image)
    rows = behind_rows(background, len(image), is_linear=is_linear).astype(np.float32)
    if depth == 8:
        result = np.empty((*image.shape[:2], 4 if background is None else 3), np.uint8)
        thresholds = _thresholds(255) if is_linear else None
        kernels().quantize(image=np.ascontiguousarray(image), background=rows, thresholds=thresholds, result=result)
        return result
    if background is not None:
        image = image[..., :3] + (1 - image[..., 3:]) * rows[:, None]
    if depth == 32:
        return np.ascontiguousarray(image)
    levels = np.floor(image.astype(np.float64) * 65535 + 0.5)
    if is_linear:
        levels[..., :3] = np.searchsorted(_thresholds(65535), image[..., :3], side="right")
    if background is None:
        alpha = image[..., 3:].astype(np.float64)
        is_seen = levels[..., 3:] > 0
        straight = np.divide(image[..., :3], alpha, out=np.zeros((*alpha.shape[:2], 3)), where=is_seen)
        levels[..., :3] = np.floor(straight * 65535 + 0.5)
        if is_linear:
            levels[..., :3] = np.searchsorted(_thresholds(65535), straight.astype(np.float32), side="right")
    return np.clip(levels, 0, 65535).astype(np.uint16)


@cache
def _thresholds(largest: int) -> npt.NDArray[np.float32]:
    """Return the linear light from which on each level above 0 of sRGB is shown, float32 [largest].

    largest: the largest level.
    """
    return linear_of_srgb((np.arange(largest) + 0.5) / largest).astype(np.float32)


def rounded(picture: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.uint8]:
    """Return a picture in [0, 1] with 8 bits a channel, rounded half up."""
    return np.asarray(np.floor(picture * 255 + 0.5), np.uint8)


def behind_rows(background: Background, height: int, *, is_linear: bool = False) -> npt.NDArray[np.float64]:
    """Return the background colour of each row of a picture, float64 [height, 3]; black for a transparent picture.

    is_linear: whether to return linear light. Colours are mixed as given in any case.
    """
    top, bottom = background if background is not None and len(background) == 2 else (background or _BLACK,) * 2
    share = (np.arange(height)[:, None] + 0.5) / height
    rows = np.asarray(top + share * np.subtract(bottom, top))
    return linear_of_srgb(rows) if is_linear else rows


def over_background(
    radiance: npt.NDArray[np.floating[Any]], background: Background, *, is_linear: bool = False
) -> npt.NDArray[np.float64]:
    """Return the unrounded picture that metrics compare: `c + (1 - a) b`, clipped to [0, 1].

    radiance: [h, w, 4], premultiplied RGBA. background: None, for a transparent film, counts as black. is_linear: as in
    `quantize`.

    Returns float64 [h, w, 3]. Raises RenderError for a value that is not finite.
    """
    behind = behind_rows(background, len(radiance), is_linear=is_linear)
    return over_rows(radiance, behind, is_linear=is_linear)


def over_rows(
    radiance: npt.NDArray[np.floating[Any]], behind: npt.NDArray[np.floating[Any]], *, is_linear: bool = False
) -> npt.NDArray[np.float64]:
    """Return rows of a picture composited over a background and clipped to [0, 1], not rounded, float64 [n, w, 3].

    radiance: [n, w, 4], premultiplied RGBA. behind: [n, 3], the background's colour in each row. is_linear: whether
    both are linear light; the picture is then encoded as sRGB. Raises RenderError for a value that is not finite.
    """
    require_finite(radiance)
    picture = np.empty((*radiance.shape[:2], 3))
    transparency = 1 - radiance[..., 3].astype(np.float64)
    for channel in range(3):
        picture[..., channel] = radiance[..., channel] + transparency * behind[:, None, channel]
    np.clip(picture, 0, 1, out=picture)
    return srgb_of_linear(picture) if is_linear else picture


def reduce_radiance(image: npt.NDArray[np.float32], factor: int) -> npt.NDArray[np.float32]:
    """Return the means of blocks of factor x factor pixels of an image [h, w, channels].

    The sides of the image are multiples of the factor.
    """
    if factor == 1:
        return image
    parts = [image[row::factor, column::factor] for row in range(factor) for column in range(factor)]
    total = sum(parts[1:], parts[0])  # the order of additions is the same on every processor
    return np.asarray(total * np.float32(1 / factor**2), np.float32)


def require_finite(image: npt.NDArray[np.floating[Any]]) -> None:
    """Raise RenderError if an image [h, w, channels] has values that are not finite; it names the first such pixel."""
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
