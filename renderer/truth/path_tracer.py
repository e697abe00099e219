"""Compute the light of rays through matter that scatters it, by Monte Carlo: paths that are followed backwards.

Matter scatters light equally in all directions. With the extinction tau and the albedo a by the transfer function, the
transmittance T, and the mean radiance phi of all directions at a point, a ray shows

    C = int T tau a phi ds,    alpha = 1 - exp(-int tau)

where phi has the light of the environment, of the key light, and of all other matter. Extinctions of layers times their
weights add up, and so do their products with albedos. Matter that clip planes, boxes and masks take away is not there
for light either. The kernel `truth_paths.cpp` says how paths are followed. Radiance is linear; a ray does not show the
sources of light behind the matter.

With surfaces, a share w of a point shows the light c E(n) / pi of a surface of normal n in place of a phi, and
highlights, as `LightSpec` says. E(n) has all light that arrives from the side of the normal.

Volumes whose voxels are colours, and factors on extinction by the gradient, are not supported.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from renderer.errors import RenderError
from renderer.kernels import IndexRays, PathLight, PathMask, PathMedium, PathSurface, kernels
from renderer.lighting import LightSources
from renderer.transfer import NO_LIGHT_GRID
from renderer.truth.integrator import Progress, fog_along, ignore, in_parts, index_rays
from renderer.truth.kept_parts import removed_sets
from renderer.truth.optics import TrueLayer, macrocell_counts, optics_of, voxels_of
from renderer.view import View
from renderer.volume import Float64, UInt64, Volume

# The number of terms of the series of the cosine, for angles of at most 180 degrees.
_NUM_TERMS = 20


class PathTracer:
    """A tracer of paths through layers, in any view. It remembers the largest extinctions of parts of the volumes.

    layers: their transfer functions have linear albedos in place of colours (`albedos_of` makes them); their shading
        and their light grids are not used.
    """

    def __init__(self, layers: Sequence[TrueLayer], light: LightSources, *, num_threads: int = 2) -> None:
        for layer in layers:
            if layer.volume.colors is not None:
                raise RenderError(
                    "paths of light do not pass a volume whose voxels are colours",
                    where=layer.volume.name,
                    hint="leave the volume out, or measure the scene without `light`",
                )
        shading = None if light.surface is None else light.surface.shading
        self._layers, self._num_threads = tuple(layers), num_threads
        self._centre = np.mean([layer.volume.centre for layer in layers], axis=0)
        self._trace = kernels().trace_paths.partial(
            layers=[optics_of(layer._replace(shading=shading, light_grid=NO_LIGHT_GRID)) for layer in layers],
            media=[self._medium_of(layer) for layer in layers],
            light=_light_of(light),
        )

    def trace(
        self, view: View, places: Float64, states: UInt64, num_paths: int, on_progress: Progress = ignore
    ) -> Float64:
        """Return the linear radiance and the opacity of rays, float64 [n, 4]. The opacity is exact.

        places: float64 [n, 2], where rays pass through the picture: x and y in pixels from its top left corner.
        states: uint64 [n], a state of random numbers for each ray (`states_of`). Rays of equal places and states are
            equal, whatever the number of threads.
        num_paths: the number of paths that begin on each ray; the radiance is their mean.
        on_progress: as in `RayIntegrator.integrate`.
        """
        radiance = np.empty((len(places), 4))

        def trace_part(part: slice) -> None:
            self._require_unchanged()
            rays = [self._rays_of(layer, view.clipped(layer.clip), places[part]) for layer in self._layers]
            fog = fog_along(view, self._centre, places[part])
            self._trace(rays=rays, fog=fog, states=states[part], num_paths=num_paths, radiance=radiance[part])

        in_parts(trace_part, len(places), self._num_threads, on_progress)
        self._require_unchanged()
        return radiance

    def _rays_of(self, layer: TrueLayer, view: View, places: Float64) -> IndexRays:
        rays = index_rays(layer.volume, view, places, self._centre)
        return rays._replace(removed=removed_sets(layer.volume, view))

    def _medium_of(self, layer: TrueLayer) -> PathMedium:
        volume, mask = layer.volume, layer.volume.mask
        return PathMedium(
            majorants=np.full(macrocell_counts(volume), np.nan),
            index_from_world=np.ascontiguousarray(np.linalg.inv(self._world_from_index(volume))[:3]).ravel(),
            world_from_index=self._world_from_index(volume)[:3].ravel(),
            voxel=volume.finest_spacing,
            mask=None if mask is None else self._mask_of(mask),
        )

    def _mask_of(self, mask: Volume) -> PathMask:
        index_from_world = np.linalg.inv(self._world_from_index(mask))[:3]
        return PathMask(voxels_of(mask), np.ascontiguousarray(index_from_world).ravel())

    def _world_from_index(self, volume: Volume) -> Float64:
        """Return the matrix [4, 4] from a volume's index space to the world, relative to the centre of all layers."""
        matrix = np.array(volume.world_from_index, np.float64)
        # From the centres, because differences of far corners would be less exact.
        matrix[:3, 3] = (volume.centre - self._centre) - matrix[:3, :3] @ volume.centre_index
        return matrix

    def _require_unchanged(self) -> None:
        for layer in self._layers:
            layer.volume.require_unchanged()


def _light_of(light: LightSources) -> PathLight:
    return PathLight(
        up=np.array(light.up, np.float64),
        environment=np.ascontiguousarray(light.environment, np.float64),
        key=np.array(light.key, np.float64),
        key_rise=_rise_of(light.key_radius),
        key_irradiance=np.array(light.key_irradiance, np.float64),
        scattering=light.scattering,
        surface=None if light.surface is None else PathSurface(*light.surface),
    )


def _rise_of(degrees: float) -> float:
    """Return 1 less the cosine of an angle, with the same bytes on every machine, unlike the cosine of C libraries."""
    square = (degrees / 180.0 * np.pi) ** 2
    total = 0.0
    for k in range(_NUM_TERMS, 0, -1):  # the series x^2 / 2! - x^4 / 4! + ..., from inside out
        total = square / ((2 * k - 1) * (2 * k)) * (1.0 - total)
    return total
