"""Find the light that all layers of a scene scatter, once for all frames on which neither they nor the light change."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import cut_bricks
from renderer.cache import NOT_KEPT, KeptArrays, cache_folder
from renderer.kernels import ClipRegion
from renderer.layers.layer import Layer
from renderer.lighting import Matter, SceneLight, solve_scene_light
from renderer.scene import FilmScene, Scene
from renderer.view import are_clipped_away, place_object_clips, with_key_of_camera
from renderer.volume import Float64


class SolvedLight(NamedTuple):
    """The light of a scene."""

    # The plain data that the light was found from, besides its exposure; equal data give equal light.
    made_from: tuple[Any, ...]
    light: SceneLight | None
    # Whether the exposure was chosen by these data, and not by those of another frame.
    is_first: bool

    def has_exposure(self, stops: float) -> bool:
        """Return whether there is light, of an exposure."""
        return self.light is not None and self.light.stops == stops


# The light of a scene without `light`.
NO_SOLVED_LIGHT = SolvedLight((), None, is_first=True)


def frames_of_new_light(film: FilmScene) -> list[tuple[int, int]]:
    """Return the runs of frames, as (first, last), on which the light that layers scatter has to be found again."""
    if film.at(0).light is None:
        return []
    return with_key_of_camera(film).map(lambda scene: (scene.light, scene.clip, scene.layers)).changing_frames


def light_of_layers(
    layers: Sequence[Layer],
    scene: Scene,
    *,
    num_threads: int,
    last: SolvedLight = NO_SOLVED_LIGHT,
    stops: float | None = None,
) -> SolvedLight:
    """Return the light that the layers of a scene scatter; without `light`, no light.

    last: the light of a scene before, which is returned if it is the same. stops: the exposure of the film's first
        frame; None for the first frame, whose light is kept in the folder of this process.

    Raises InputError if the light does not fit into memory, or if a volume's file was changed.
    """
    if scene.light is None:
        return NO_SOLVED_LIGHT
    made_from = (
        scene.light,
        scene.clip,
        *((layer.digest, layer.spec.weight, layer.spec.clip) for layer in layers),
        *(layer.volume.world_from_index.tobytes() for layer in layers),
    )
    if made_from == last.made_from and (last.is_first if stops is None else last.has_exposure(stops)):
        return last
    matter = []
    for layer in layers:
        clip = place_object_clips(layer.volume, scene.clip + layer.spec.clip)
        are_removed = None if clip is None else partial(are_clipped_away, clip)
        matter.append(Matter(layer.volume, layer.optics, layer.spec.weight, are_removed, _reach(layer, clip)))
    # The light of other frames is not kept: in a film of 120 frames, it would take gigabytes.
    kept = NOT_KEPT if stops is not None else KeptArrays(cache_folder(), "scattered", _digest_of(made_from))
    light = solve_scene_light(matter, scene.light, stops=stops, num_threads=num_threads, kept=kept)
    return SolvedLight(made_from, light, is_first=stops is None)


def _digest_of(made_from: tuple[Any, ...]) -> str:
    return hashlib.blake2b(repr(made_from).encode(), digest_size=16).hexdigest()


def _reach(layer: Layer, clip: ClipRegion | None) -> Float64:
    """Return the corners of the visible bounds of all bricks, in the world, float64 [n, 3].

    clip: the region that clipping leaves; None for all.
    """
    assert layer.bricks is not None  # splats scatter no light
    bounds = cut_bricks(layer.bricks, 0.0).visible_bounds
    if clip is not None:
        bounds = bounds[~are_clipped_away(clip, bounds - layer.volume.centre_index)]
    x, y, z = np.indices((2, 2, 2)).reshape(3, -1)
    corners = np.stack([bounds[:, x, 0], bounds[:, y, 1], bounds[:, z, 2]], axis=-1).reshape(-1, 3)
    return np.asarray(corners @ layer.volume.world_from_index[:3, :3].T + layer.volume.world_from_index[:3, 3])
