"""Choose the exposure of a scene's light, so that the brightest of the visible matter shows its colours.

The matter is seen along the six axes of the grid. In even white light it would show its colours; in the scene's light
it shows albedo times mean radiance. Pixels are compared by their ratio: the exposure makes BRIGHT_SHARE of all that is
seen at most as bright as in even white light.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from renderer.lighting.radiance_grid import RadianceGrid
from renderer.transfer import color_of_thick
from renderer.volume import Float32, Float64

# The share of the visible matter that shows at most its colours.
BRIGHT_SHARE = 0.9
# The weights of linear red, green and blue in luminance (Rec. 709).
_LUMINANCE = (0.2126, 0.7152, 0.0722)
# The exposure is a multiple of this, in stops, so that the processor's rounding does not change it.
_STEP_STOPS = 1 / 64


def choose_stops(grid: RadianceGrid) -> float:
    """Return the exposure for a light, in stops; 0 where nothing is visible or no light arrives."""
    pictures = [np.concatenate([picture[k].ravel() for picture in _pictures(grid)]) for k in range(2)]
    shown, even = (picture.astype(np.float64) for picture in pictures)
    seen = even > 0
    ratios, weights = shown[seen] / even[seen], even[seen]
    order = np.argsort(ratios, kind="stable")
    so_far = np.cumsum(weights[order])
    if not seen.any():
        return 0.0
    ratio = float(ratios[order][np.searchsorted(so_far, BRIGHT_SHARE * so_far[-1])])
    return round(-np.log2(ratio) / _STEP_STOPS) * _STEP_STOPS if ratio > 0 else 0.0


def _pictures(grid: RadianceGrid) -> Iterator[tuple[Float32, Float32]]:
    """Yield, for each of six views, the luminance in the scene's light and in even white light, float32 [n, m]."""
    x = grid.matter.shape_xyz[0]
    cells = grid.matter.cells[..., :x]
    depths = cells[3]
    albedos = np.divide(cells[:3], depths, out=np.zeros_like(cells[:3]), where=depths > 0)
    opacities = -np.expm1(-depths)
    radiance = np.moveaxis(grid.mean_radiance, -1, 0)
    scattered = opacities * _luminance(albedos * radiance)
    colored = opacities * _luminance(_colors(albedos, opacities).astype(np.float32))
    for axis in range(3):
        for is_reversed in (False, True):
            yield _seen_along((opacities, scattered, colored), axis, is_reversed=is_reversed)


def _colors(albedos: Float32, opacities: Float32) -> Float64:
    """Return the linear colours that cells show in even white light: of thick matter if opaque, else their albedos."""
    return np.asarray((1 - opacities) * albedos + opacities * color_of_thick(albedos))


def _luminance(colors: Float32) -> Float32:
    red, green, blue = colors
    return np.asarray(_LUMINANCE[0] * red + _LUMINANCE[1] * green + _LUMINANCE[2] * blue, np.float32)


def _seen_along(arrays: tuple[Float32, Float32, Float32], axis: int, *, is_reversed: bool) -> tuple[Float32, Float32]:
    """Return two pictures along an axis. arrays: opacities, and the numbers of both pictures at cells, [z, y, x]."""
    planes = [np.moveaxis(array, axis, 0)[:: -1 if is_reversed else 1] for array in arrays]
    transmittance, one, other = (np.zeros(planes[0].shape[1:], np.float32) for _ in range(3))
    transmittance += 1
    for opacity, first, second in zip(*planes, strict=True):
        one += transmittance * first
        other += transmittance * second
        transmittance *= 1 - opacity
    return one, other
