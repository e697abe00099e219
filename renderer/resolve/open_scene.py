"""Resolve a scene: choose, once its volumes can be read, everything that it leaves open."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

from renderer.errors import Problem
from renderer.readers import ReadVolume, looking_once
from renderer.resolve.open_labels import with_labels, with_numbers
from renderer.resolve.percentile_values import with_values
from renderer.resolve.store_levels import with_levels
from renderer.scene import (
    AnyScene,
    LayerSpec,
    MaskSpec,
    Motion,
    OverFrames,
    Scene,
    SharedKeys,
    VolumeSpec,
    moving,
    raise_problems,
)
from renderer.suggest import NO_WISH, channel_layers, suggest_in_time, with_own_names


def resolve_scene(scene: AnyScene, read: ReadVolume) -> AnyScene:
    """Return the scene with nothing left open.

    Volumes in stores get the number of a level. Each `component: all` becomes a list of layers, one for each channel;
    `time: auto` becomes a motion; labels get numbers and colours; voxels that are colours get a transfer function;
    percentiles become values.

    read: reads the voxels of one channel at one step in time. Raises InputError for volumes that cannot be read, or are
    no labels where the scene has labels, and SceneError for labels that no voxel has and for percentiles with the same
    value.
    """
    resolve = partial(_resolved, read=read)
    with looking_once():
        return with_levels(scene, lambda each: each.changed(resolve)).changed(resolve)


def _resolved(scene: Scene, read: ReadVolume) -> Scene:
    """Return the scene with nothing left open, as in `resolve_scene`. Values that move stay as they are."""
    problems = list[Problem]()

    @cache
    def with_mask(mask: MaskSpec | None, place: str) -> MaskSpec | None:
        """Return a resolved mask. A mask that all layers share is resolved once."""
        return with_numbers(_mask_in_time(mask, scene.num_frames, read), place, read, problems)

    layers, num_channels = list[LayerSpec](), 0
    for number, layer in enumerate(scene.layers):
        volume = _volume_in_time(layer.volume, scene.num_frames, read)
        mask = with_mask(layer.mask, scene.layer_key(number, "mask"))
        num_before = num_channels if len(scene.layers) > 1 else None
        made = _channels(replace(layer, volume=volume, mask=mask), read, num_before)
        num_channels += len(made) * (layer.volume.component == "all")
        for each in made:
            plain = with_values(each, scene.layer_key(number, "transfer_function"), read, problems)
            layers.append(with_labels(plain, scene.layer_key(number, "labels"), read, problems))
    shared = scene.shared
    if shared is None and scene.layers[0].volume.component == "all":  # one layer becomes a layer for each channel
        shared = SharedKeys(layers[0].shading, layers[0].mask)
    elif shared is not None:
        shared = replace(shared, mask=with_mask(shared.mask, "mask"))
    raise_problems(problems)
    return replace(scene, layers=tuple(with_own_names(layers)), shared=shared)


def _channels(layer: LayerSpec, read: ReadVolume, num_before: int | None) -> list[LayerSpec]:
    """Return a layer for each channel of a volume, if all are shown; otherwise the layer itself.

    num_before: as in `channel_layers`. A layer whose voxels are colours gets a transfer function, if it has none.
    """
    if layer.volume.component == "all":
        return channel_layers(layer, read(replace(_first(layer.volume), component=0)), read, num_before=num_before)
    return [_with_colors(layer, read) if layer.has_open_colors else layer]


def _mask_in_time(mask: MaskSpec | None, num_frames: int, read: ReadVolume) -> MaskSpec | None:
    if mask is None or not isinstance(mask.volume, VolumeSpec):
        return mask
    return replace(mask, volume=_volume_in_time(mask.volume, num_frames, read))


def _volume_in_time(volume: VolumeSpec, num_frames: int, read: ReadVolume) -> VolumeSpec:
    if volume.time != "auto":
        return volume
    component = 0 if volume.component == "all" else volume.component
    last = read(replace(_first(volume), time=0, component=component)).num_times - 1
    ends = (0.0, float(last)) if volume.interpolate else (0, last)
    return replace(volume, time=moving(Motion((0, max(1, num_frames - 1)), ends)))


def _with_colors(layer: LayerSpec, read: ReadVolume) -> LayerSpec:
    """Return a layer whose voxels are colours with the transfer function that is suggested for them."""
    found = suggest_in_time(OverFrames(layer.volume), read, NO_WISH)
    shown = replace(layer.volume, component=found.volume.component)
    return replace(layer, volume=shown, transfer_function=found.suggestion.transfer)


def _first(volume: VolumeSpec) -> VolumeSpec:
    """Return the description of a volume at the first frame of a film."""
    return OverFrames(volume).at(0)
