"""Choose the exposure of a scene's light, so that the brightest of the visible matter shows its colours.

The matter is seen along the six axes of the grid. In even white light it would show its colours; in the scene's light
it shows albedo times mean radiance, and its surfaces what they reflect to the viewer. Pixels are compared by the ratio
of their brightest channels, as a picture cuts these off first: the exposure makes BRIGHT_SHARE of all that is seen at
most as bright as in even white light.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from renderer.lighting.environment import LightSources
from renderer.lighting.radiance_grid import RadianceGrid
from renderer.scene import SurfaceSpec
from renderer.transfer import color_of_thick, surface_reflectance
from renderer.volume import Float32, Float64

# The share of the visible matter that shows at most its colours.
BRIGHT_SHARE = 0.9
# The exposure is a multiple of this, in stops, so that the processor's rounding does not change it.
_STEP_STOPS = 1 / 64
# The length, in cells, whose opacity tells surfaces. Pictures measure it in voxels, which most cells are as wide as.
_OPACITY_CELLS = 4.0


class _Matter(NamedTuple):
    """The matter of cells, and the light that it scatters to all sides."""

    # [z, y, x]: the optical depths of cells, and their opacities.
    depths: Float32
    opacities: Float32
    # [rgb, z, y, x]: the albedos, and the albedos times the mean radiance.
    albedos: Float32
    scattered: Float32


def choose_stops(grid: RadianceGrid, sources: LightSources) -> float:
    """Return the exposure for a light, in stops; 0 where nothing is visible or no light arrives."""
    pictures = [np.concatenate([picture[k].ravel() for picture in _pictures(grid, sources)]) for k in range(2)]
    shown, even = (picture.astype(np.float64) for picture in pictures)
    seen = even > 0
    ratios, weights = shown[seen] / even[seen], even[seen]
    order = np.argsort(ratios, kind="stable")
    so_far = np.cumsum(weights[order])
    if not seen.any():
        return 0.0
    ratio = float(ratios[order][np.searchsorted(so_far, BRIGHT_SHARE * so_far[-1])])
    return round(-np.log2(ratio) / _STEP_STOPS) * _STEP_STOPS if ratio > 0 else 0.0


def _pictures(grid: RadianceGrid, sources: LightSources) -> Iterator[tuple[Float32, Float32]]:
    """Yield, for each of six views, the brightest channel in the scene's light and in even white light."""
    x = grid.matter.shape_xyz[0]
    cells = grid.matter.cells[..., :x]
    depths = cells[3]
    albedos = np.divide(cells[:3], depths, out=np.zeros_like(cells[:3]), where=depths > 0)
    radiance = np.moveaxis(grid.mean_radiance, -1, 0)
    matter = _Matter(depths, -np.expm1(-depths), albedos, albedos * radiance)
    surfaces = None if sources.surface is None else _Surfaces(grid, matter, sources, sources.surface)
    scattered = matter.opacities * _brightest(matter.scattered)
    colored = matter.opacities * _brightest(_colors(albedos, matter.opacities).astype(np.float32))
    for axis in range(3):
        for is_reversed in (False, True):
            if surfaces is not None:
                to_viewer = np.zeros(3)
                to_viewer[2 - axis] = 1.0 if is_reversed else -1.0
                scattered = matter.opacities * _brightest(surfaces.shown_to(to_viewer))
            yield _seen_along((matter.opacities, scattered, colored), axis, is_reversed=is_reversed)


class _Surfaces:
    """The light that cells show, whose surfaces are where the opacity changes from cell to cell."""

    def __init__(self, grid: RadianceGrid, matter: _Matter, sources: LightSources, spec: SurfaceSpec) -> None:
        assert grid.flux is not None, "of a light with surfaces"
        self._spec, self._key = spec, np.array(sources.key, np.float32)
        key_light = (sources.key_irradiance / np.pi).astype(np.float32)[:, None, None, None]
        # [xyz, z, y, x]: the change of opacity between the cells before and behind, and the normal.
        rise = 2 * np.stack(np.gradient(-np.expm1(-_OPACITY_CELLS * matter.depths))[::-1])
        length = np.sqrt((rise**2).sum(axis=0))
        self._normals = np.divide(-rise, length, out=np.zeros_like(rise), where=length > 0)
        self._shares = (spec.share * np.minimum(length, 1)).astype(np.float32)
        to_key = np.maximum(np.tensordot(self._key, self._normals, 1), 0)
        around = np.moveaxis(grid.mean_radiance, -1, 0) - grid.key / 4 * key_light
        across = np.einsum("azyx,zyxac->czyx", self._normals, grid.flux)
        irradiance = np.maximum(around + 2 * across, 0) + grid.key * to_key * key_light
        reflected = surface_reflectance(matter.albedos).astype(np.float32) * irradiance
        self._without_highlights = (1 - self._shares) * matter.scattered + self._shares * reflected
        self._of_highlights = np.where(to_key > 0, self._shares * grid.key, 0) * key_light

    def shown_to(self, to_viewer: Float64) -> Float32:
        """Return the light that cells show in a direction, float32 [rgb, z, y, x]."""
        halfway = self._key + to_viewer
        halfway /= max(float(np.linalg.norm(halfway)), 1e-12)
        cosines = np.maximum(np.tensordot(halfway.astype(np.float32), self._normals, 1), 0)
        highlights = self._spec.specular * cosines**self._spec.shininess
        return np.asarray(self._without_highlights + highlights * self._of_highlights, np.float32)


def _colors(albedos: Float32, opacities: Float32) -> Float64:
    """Return the linear colours that cells show in even white light: of thick matter if opaque, else their albedos."""
    return np.asarray((1 - opacities) * albedos + opacities * color_of_thick(albedos))


def _brightest(colors: Float32) -> Float32:
    """Return the largest of red, green and blue, which a picture cuts off first."""
    return np.asarray(colors.max(axis=0))


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
