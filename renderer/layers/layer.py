"""Make a layer from plain data: its volume, its optics, its light, its pyramid and its bricks."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from renderer.bricks import BrickBatch, BrickLayer, BrickLayers, Bricks, extreme_bricks, make_bricks
from renderer.cache import NOT_KEPT, KeptArrays
from renderer.kernels import LightGrid
from renderer.layers.label_numbers import leave_out_masked, number_labels
from renderer.lighting import compute_light_grid
from renderer.modes import Projection, make_projection
from renderer.pyramid import EVERY_CUT, FinestCut, Pyramid, build_pyramid
from renderer.scene import RAMP_THICKNESS, FilmScene, LayerSpec, OverFrames, Scene, ShadingSpec
from renderer.transfer import NO_LIGHT_GRID, TransferFunction, albedos_of, make_transfer_function
from renderer.view import are_clipped_away, place_object_clips
from renderer.volume import Volume, move_volume


@dataclass(frozen=True)
class Layer:
    """A layer of a scene: a volume, with everything that its pictures from any camera share.

    spec: the layer's section of the scene.
    volume: the volume; labels in it are replaced by their numbers.
    transfer: the scene's colours and opacities.
    projection: the projection of the scene's mode; None for emission and absorption.
    shading: the scene's shading of the layer, or the shading by which surfaces are found in a scene with `light`.
    optics: the transfer function that is drawn: the projection's, the albedos of matter that scatters light, or the
        scene's.
    light_grid: the light that reaches each place in the volume.
    pyramid: the averages of voxels, from which cells are drawn.
    bricks: the bricks; None if splats are drawn.
    extreme_bricks: the bricks in which rays look for an extremum; None in modes without extrema.
    digest: the digest of the plain data from which the layer was made, and of its voxels.
    """

    spec: LayerSpec
    volume: Volume
    transfer: TransferFunction
    projection: Projection | None
    shading: ShadingSpec | None
    optics: TransferFunction
    light_grid: LightGrid
    pyramid: Pyramid
    bricks: Bricks | None
    extreme_bricks: BrickBatch | None
    digest: str


def layer_parts(spec: LayerSpec, scene: Scene) -> tuple[Any, ...]:
    """Return the parts of a scene that a layer is made from, besides its volume.

    The parts do not include the layer's name and weight, or the camera. They include clipping only if light or extrema
    depend on clipping.
    """
    return _parts(spec, scene, _Held.by(spec, scene))


def parts_over_frames(film: FilmScene, number: int) -> OverFrames[tuple[Any, ...]]:
    """Return a map from frames to the parts of a film scene that one of its layers is made from.

    Which parts these are is decided on the first frame, as by `layer_parts`. number: the layer's index in the film.
    """
    first = film.at(0)
    held = _Held.by(first.layers[number], first)
    return film.map(lambda scene: _parts(scene.layers[number], scene, held))


def frames_of_new_layers(film: FilmScene, number: int) -> list[tuple[int, int]]:
    """Return the runs of frames, as (first, last), on which a layer of a film has to be made anew.

    number: the layer's index in the film.
    """
    placed = film.film_layers[number].map(lambda layer: (layer.volume, layer.transform))
    return OverFrames((placed, parts_over_frames(film, number))).changing_frames


@dataclass(frozen=True)
class _Held:
    """A choice of the parts of a scene on which a layer depends.

    clip: whether the layer depends on the clip planes and boxes.
    shading: whether the layer depends on the whole shading, which is then part of the means of cells; otherwise it
        depends only on the settings of the light grid.
    light: whether the light grid depends on the direction of the light, which casts shadows.
    """

    clip: bool
    shading: bool
    light: bool

    @classmethod
    def by(cls, spec: LayerSpec, scene: Scene) -> _Held:
        """Return the choice of the parts of a scene on which one of its layers depends."""
        shading = scene.shading_of(spec)
        has_light_grid = shading is not None and shading.has_light_grid
        has_shadow = shading is not None and shading.shadow > 0
        is_whole = shading is None or (shading.lambert is not None and spec.transfer_function.labels is None)
        return cls(scene.mode.is_extremum or has_light_grid, is_whole, has_shadow)


def _parts(spec: LayerSpec, scene: Scene, held: _Held) -> tuple[Any, ...]:
    """Return the parts of a scene that a layer is made from, as `layer_parts` does. held: the choice of the parts."""
    shading: Any = scene.shading_of(spec)
    if shading is not None and not held.shading:
        light = shading.light if held.light else None
        shading = light, shading.occlusion, shading.shadow, shading.occlusion_radius
    return (
        spec.mask, spec.transfer_function, spec.color, shading,
        scene.clip + spec.clip if held.clip else (),
        scene.mode, scene.pyramid, scene.error.measure, scene.error.of, scene.needs_opengl, scene.light is not None,
    )  # fmt: skip


def layer_digest(spec: LayerSpec, scene: Scene, volume: Volume, finest_cut: FinestCut) -> str:
    """Return a digest by which a layer is found again: of its voxels, and of the parts of a scene it is made from."""
    facts = volume.fingerprint, volume.is_labels, volume.opacity_unit
    made_from = (*facts, *layer_parts(spec, scene), finest_cut)
    return hashlib.blake2b(repr(made_from).encode(), digest_size=16).hexdigest()


def make_layer(
    spec: LayerSpec,
    scene: Scene,
    volume: Volume,
    *,
    finest_cut: FinestCut = EVERY_CUT,
    num_threads: int,
    lap: Callable[[str], object],
) -> Layer:
    """Make a layer of a scene from its volume. The result does not depend on `num_threads`.

    finest_cut: the bound of the cuts that will be made of the pyramid. lap: a function that is called with the name of
    each finished step. Raises InputError if the volume's file was changed.
    """
    digest, num_bytes, read = layer_digest(spec, scene, volume, finest_cut), volume.values.nbytes, volume.values
    transfer = _transfer_of(spec, volume)
    if (labels := spec.transfer_function.labels) is not None:
        volume = number_labels(volume, labels.values)
    if volume.mask is not None and (scene.mode.is_projection or scene.needs_opengl):
        volume = leave_out_masked(volume)  # projections and splats can leave out absent voxels, but apply no masks
    are_own = volume.values is read and not volume.is_labels  # labels are numbered by the look
    kept_ranges = KeptArrays.of("ranges", volume.fingerprint, num_bytes) if are_own else NOT_KEPT
    known = kept_ranges.find()
    ranges = None if known is None else known["ranges"]
    projection = make_projection(scene.mode, transfer, volume)
    optics = _optics_of(transfer, projection, scene, volume)
    light_grid = NO_LIGHT_GRID
    shading = scene.shading_of(spec)
    if shading is not None and shading.has_light_grid:
        clip = place_object_clips(volume, scene.clip + spec.clip)
        are_removed = None if clip is None else partial(are_clipped_away, clip)
        light_grid = compute_light_grid(
            volume, optics, shading, are_removed=are_removed, num_threads=num_threads,
            kept=KeptArrays.of("light", digest, num_bytes), ranges=ranges,
        )  # fmt: skip
        lap("light")
    baked = shading and shading.lambert  # other shading is computed at samples between voxels
    baked = None if volume.is_labels else baked
    options: dict[str, Any] = {"spec": scene.pyramid, "error": scene.error, "shading": baked}
    options |= {"light_grid": light_grid, "num_threads": num_threads}
    bricks = extremes = None
    if scene.needs_opengl:
        pyramid = build_pyramid(volume, optics, finest_cut=finest_cut, ranges=ranges, **options)
    else:
        has_lit_labels = volume.is_labels and shading is not None
        kept = KeptArrays.of("bricks", digest, num_bytes)
        bricks = make_bricks(volume, optics, has_lit_labels=has_lit_labels, kept=kept, ranges=ranges, **options)
        pyramid = bricks.pyramid
        if known is None:
            kept_ranges.keep({"ranges": bricks.ranges})
        if scene.mode.is_extremum:
            alone = BrickLayers((BrickLayer(bricks),), spec.clip)
            extremes = extreme_bricks(alone, scene.mode)
    lap("pyramid")
    return Layer(spec, volume, transfer, projection, shading, optics, light_grid, pyramid, bricks, extremes, digest)


def with_level(layer: Layer, volume: Volume | None, scene: Scene) -> Layer:
    """Return a layer that shows another level of its volume, for exact rays, without occlusion and shadows.

    scene: the scene of the layer.
    volume: the other level, which is unplaced; None for the layer's own. Pyramid and bricks remain those of the own
    level.
    """
    spec = layer.spec
    if spec.shading is not None:
        spec = replace(spec, shading=replace(spec.shading, occlusion=0.0, shadow=0.0))
    layer = replace(layer, spec=spec, light_grid=NO_LIGHT_GRID)
    if volume is None:
        return layer
    if spec.transform is not None:
        volume = move_volume(volume, np.array(spec.transform))
    volume = replace(volume, mask=layer.volume.mask)
    transfer = _transfer_of(spec, volume)
    if (labels := spec.transfer_function.labels) is not None:
        volume = number_labels(volume, labels.values)
    optics = _optics_of(transfer, layer.projection, scene, volume)
    return replace(layer, volume=volume, transfer=transfer, optics=optics)


def _optics_of(
    transfer: TransferFunction, projection: Projection | None, scene: Scene, volume: Volume
) -> TransferFunction:
    """Return the transfer function that is drawn for a layer, as in Layer."""
    if projection is not None:
        return projection.optics
    return transfer if scene.light is None else albedos_of(transfer, volume.finest_spacing)


def _transfer_of(spec: LayerSpec, volume: Volume) -> TransferFunction:
    """Return the transfer function of a layer with a volume."""
    unit = spec.transfer_function.unit or volume.opacity_unit
    if spec.color is not None:
        unit = RAMP_THICKNESS * float((volume.spacing * volume.shape_xyz).max())
    return make_transfer_function(replace(spec.transfer_function, unit=unit), volume.finest_spacing)
