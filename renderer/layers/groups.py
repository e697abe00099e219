"""Group the layers that are drawn together, because they share a grid of voxels and clip planes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from renderer.bricks import BrickLayer, BrickLayers
from renderer.layers.layer import Layer
from renderer.lighting import SceneLight
from renderer.modes import Projection
from renderer.scene import Scene
from renderer.volume import Volume


@dataclass(frozen=True)
class LayerGroup:
    """A group of layers on one grid of voxels, which are drawn together.

    bricks: the bricks of all layers; None if splats are drawn.
    """

    layers: tuple[Layer, ...]
    bricks: BrickLayers | None

    @property
    def volume(self) -> Volume:
        """Return the volume of the first layer, whose grid all layers share."""
        return self.layers[0].volume

    @property
    def light(self) -> SceneLight | None:
        """Return the light that the layers scatter; None without such light."""
        return None if self.bricks is None else self.bricks.light

    @property
    def projection(self) -> Projection | None:
        """Return the projection of the group's only layer; None for emission and absorption."""
        return self.layers[0].projection

    @property
    def draws_voxels_only(self) -> bool:
        """Return whether single voxels are drawn at every tolerance, because means of larger cells lack the shading."""
        lit = [(layer.shading, layer.volume.is_labels) for layer in self.layers if layer.shading is not None]
        return any(shading.is_pointwise or is_labels for shading, is_labels in lit)


def group_layers(layers: Sequence[Layer], scene: Scene, light: SceneLight | None = None) -> tuple[LayerGroup, ...]:
    """Return the groups of a scene's layers. In the modes of projections, each layer is a group of its own.

    light: the light that all layers scatter; None without such light.
    """
    groups: dict[object, list[Layer]] = {}
    for number, layer in enumerate(layers):
        grid = layer.volume.shape_xyz, layer.volume.world_from_index.tobytes(), layer.spec.clip
        groups.setdefault(number if layer.projection is not None else grid, []).append(layer)
    return tuple(LayerGroup(tuple(group), _bricks_of(group, scene, light)) for group in groups.values())


def _bricks_of(group: Sequence[Layer], scene: Scene, light: SceneLight | None) -> BrickLayers | None:
    if scene.needs_opengl:
        return None
    if (extremes := group[0].extreme_bricks) is not None:
        return extremes.bricks
    is_projection = scene.mode.is_projection  # the weights of projections are factors on pictures, not on extinctions
    bricks = [
        BrickLayer(each.bricks, each.shading, 1.0 if is_projection else each.spec.weight)
        for each in group
        if each.bricks is not None
    ]
    return BrickLayers(tuple(bricks), group[0].spec.clip, scene.blend == "add", light)
