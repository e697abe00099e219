"""Make a layer from plain data: its volume, its optics, its light, its pyramid and its bricks."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from renderer.bricks import BrickBatch, BrickLayer, BrickLayers, Bricks, extreme_bricks, make_bricks
from renderer.kernels import LightGrid
from renderer.layers.label_numbers import leave_out_masked, number_labels
from renderer.lighting import compute_light_grid
from renderer.modes import Projection, make_projection
from renderer.pyramid import EVERY_CUT, FinestCut, Pyramid, build_pyramid
from renderer.scene import RAMP_THICKNESS, LayerSpec, Scene
from renderer.transfer import NO_LIGHT_GRID, TransferFunction, make_transfer_function
from renderer.view import are_clipped_away, place_object_clips
from renderer.volume import Volume


@dataclass(frozen=True)
class Layer:
    """A volume of a scene, and all that pictures of it have in common.

    volume: of labels, with numbers in their place. transfer: the scene's colours and opacities. projection: what the
        mode colours; None for emission and absorption.
    bricks: if the footprint is drawn from bricks. extreme_bricks: those in which rays look for extremes, if they do.
    digest: of the plain data from which it was made, and of its voxels.
    """

    spec: LayerSpec
    volume: Volume
    transfer: TransferFunction
    projection: Projection | None
    light_grid: LightGrid
    pyramid: Pyramid
    bricks: Bricks | None
    extreme_bricks: BrickBatch | None
    digest: str

    @property
    def optics(self) -> TransferFunction:
        """Return what is drawn: the transfer function, or what stands in its place in a projection."""
        return self.transfer if self.projection is None else self.projection.optics


def layer_parts(spec: LayerSpec, scene: Scene) -> tuple[Any, ...]:
    """Return the parts of a scene that a layer is made from, besides its volume.

    Its name, its weight and the camera do not count, and clipping counts only where light or extremes depend on it.
    """
    is_clipped = scene.mode.is_extremum or (spec.shading is not None and spec.shading.has_light_grid)
    return (
        spec.mask, spec.transfer_function, spec.color, _shading_part(spec),
        scene.clip + spec.clip if is_clipped else (),
        scene.mode, scene.pyramid, scene.error.measure, scene.error.of, scene.needs_opengl,
    )  # fmt: skip


def _shading_part(spec: LayerSpec) -> object:
    """Return what of its shading a layer holds: all, in the means of cells, or the light that reaches each place."""
    shading = spec.shading
    if shading is None or (shading.lambert is not None and spec.transfer_function.labels is None):
        return shading
    light = shading.light if shading.shadow > 0 else None
    return light, shading.occlusion, shading.shadow, shading.occlusion_radius


def layer_digest(spec: LayerSpec, scene: Scene, volume: Volume, finest_cut: FinestCut) -> str:
    """Return the digest of what a layer is made from."""
    made_from = (volume.fingerprint, *layer_parts(spec, scene), finest_cut)
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
    """Make a layer of a scene around its volume; the result does not depend on `num_threads`.

    finest_cut: as in `build_pyramid`. lap: takes the name of each step that has ended.
    Raises InputError where the volume's file was changed.
    """
    look = spec.transfer_function
    if spec.color is not None:
        look = replace(look, unit=RAMP_THICKNESS * float((volume.spacing * volume.shape_xyz).max()))
    transfer = make_transfer_function(look, volume.finest_spacing)
    if (labels := spec.transfer_function.labels) is not None:
        volume = number_labels(volume, labels.values)
    if volume.mask is not None and (scene.mode.is_projection or scene.needs_opengl):
        volume = leave_out_masked(volume)  # of which extremes and splats know
    projection = make_projection(scene.mode, transfer, volume)
    optics = transfer if projection is None else projection.optics
    light_grid = NO_LIGHT_GRID
    if spec.shading is not None and spec.shading.has_light_grid:
        clip = place_object_clips(volume, scene.clip + spec.clip)
        are_removed = None if clip is None else partial(are_clipped_away, clip)
        light_grid = compute_light_grid(volume, optics, spec.shading, are_removed=are_removed, num_threads=num_threads)
        lap("light")
    baked = spec.shading and spec.shading.lambert  # other shading is left to samples between voxels, as of labels
    baked = None if volume.is_labels else baked
    options: dict[str, Any] = {"spec": scene.pyramid, "error": scene.error, "shading": baked}
    options |= {"light_grid": light_grid, "num_threads": num_threads, "finest_cut": finest_cut}
    bricks = extremes = None
    if scene.needs_opengl:
        pyramid = build_pyramid(volume, optics, **options)
    else:
        has_lit_labels = volume.is_labels and spec.shading is not None
        bricks = make_bricks(volume, optics, has_lit_labels=has_lit_labels, **options)
        pyramid = bricks.pyramid
        if scene.mode.is_extremum:
            alone = BrickLayers((BrickLayer(bricks),), spec.clip)
            extremes = extreme_bricks(alone, scene.mode, num_threads=num_threads)
    lap("pyramid")
    digest = layer_digest(spec, scene, volume, finest_cut)
    return Layer(spec, volume, transfer, projection, light_grid, pyramid, bricks, extremes, digest)
