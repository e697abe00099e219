"""Resolve a scene: choose all that it leaves to its volumes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from renderer.errors import Problem
from renderer.readers import ReadVolume
from renderer.resolve.open_labels import with_labels, with_numbers
from renderer.resolve.percentile_values import with_values
from renderer.scene import (
    AnyScene,
    LayerSpec,
    MaskSpec,
    Motion,
    OverFrames,
    Scene,
    VolumeSpec,
    moving,
    raise_problems,
)
from renderer.suggest import NO_WISH, channel_layers, suggest_in_time, with_own_names


def resolve_scene(scene: AnyScene, read: ReadVolume) -> AnyScene:
    """Return a scene that leaves nothing open.

    Each `component: all` becomes a list of volumes, one for each channel; `time: auto` becomes a motion; labels get
    numbers and colours; voxels that are colours get a transfer function; percentiles become values.

    read: reads the voxels: of one channel, and of the channels without a window. Raises InputError as it does, and as
    `with_labels`; SceneError for labels that are not there, and percentiles that do not differ.
    """
    return scene.changed(partial(_resolved, read=read))


def _resolved(scene: Scene, read: ReadVolume) -> Scene:
    """Return the scene of `resolve_scene`. It passes motions on, and does not calculate with them."""
    given = scene.volumes or (LayerSpec(scene.volume, scene.transfer_function),)
    layers, problems = list[LayerSpec](), list[Problem]()
    for number, layer in enumerate(_layer_in_time(layer, scene.num_frames, read) for layer in given):
        if layer.volume.component == "all":
            own = channel_layers(layer, read(replace(_first(layer.volume), component=0)), read)
        else:
            own = [_with_colors(layer, read) if layer.has_open_colors else layer]
        place = f"volumes.{number}." if scene.volumes else ""
        layers += [with_values(each, f"{place}transfer_function", read, problems) for each in own]
    is_list = bool(scene.volumes) or scene.volume.component == "all"
    places = [f"volumes.{number}." if is_list else "" for number in range(len(layers))]
    named = zip(with_own_names(layers), places, strict=True)
    found = tuple(with_labels(layer, place, read, problems) for layer, place in named)
    mask = with_numbers(_mask_in_time(scene.mask, scene.num_frames, read), "mask", read, problems)
    raise_problems(problems)
    first, volumes = found[0], found if is_list else ()
    return replace(scene, volume=first.volume, transfer_function=first.transfer_function, volumes=volumes, mask=mask)


def _layer_in_time(layer: LayerSpec, num_frames: int, read: ReadVolume) -> LayerSpec:
    """Return a layer in which `time: auto`, of its volume and of its mask, is a motion through all steps."""
    mask = _mask_in_time(layer.mask, num_frames, read)
    return replace(layer, volume=_volume_in_time(layer.volume, num_frames, read), mask=mask)


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
    """Return a layer of colours with the transfer function that is suggested for them."""
    found = suggest_in_time(OverFrames(layer.volume), read, NO_WISH)
    shown = replace(layer.volume, component=found.volume.component)
    return replace(layer, volume=shown, transfer_function=found.suggestion.transfer)


def _first(volume: VolumeSpec) -> VolumeSpec:
    """Return a volume as it is on the first frame."""
    return OverFrames(volume).at(0)
