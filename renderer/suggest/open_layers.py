"""Choose what a scene leaves open: the layers of `component: all`, looks of labels and colours, and percentiles."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from renderer.errors import Problem
from renderer.scene import (
    AnyScene,
    LayerSpec,
    Motion,
    OverFrames,
    Scene,
    VolumeSpec,
    moving,
    raise_problems,
    steps_in_time,
)
from renderer.suggest.channels import ReadVolume, channel_layers, with_own_names
from renderer.suggest.label_choice import with_labels, with_numbers
from renderer.suggest.relative import with_values
from renderer.suggest.unread import suggest_in_time
from renderer.suggest.volume_suggestion import NO_WISH, read_in_colors, suggest_read


def resolve_scene(scene: AnyScene, read: ReadVolume) -> AnyScene:
    """Return a scene in which a list of volumes, one for each channel, is in place of each `component: all`, in which
    `time: auto` is a motion, labels have numbers and colours, voxels that are colours a transfer function, and values
    are in place of percentiles.

    read: reads the voxels: those of one channel, and of those without a window. Raises InputError as it does, and as
    `with_labels`; SceneError for labels that are not there, and percentiles that do not differ.
    """
    return scene.changed(partial(_resolved, read=read))


def _resolved(scene: Scene, read: ReadVolume) -> Scene:
    """Return the scene of `resolve_scene`. Values in it may be motions, with which nothing is calculated here."""
    given = scene.volumes or (LayerSpec(scene.volume, scene.transfer_function),)
    layers, problems = list[LayerSpec](), list[Problem]()
    for number, layer in enumerate(_with_times(layer, scene.num_frames, read) for layer in given):
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
    mask = with_numbers(_with_times(scene.mask, scene.num_frames, read), "mask", read, problems)
    raise_problems(problems)
    first, volumes = found[0], found if is_list else ()
    return replace(scene, volume=first.volume, transfer_function=first.transfer_function, volumes=volumes, mask=mask)


def _with_times(part: Any, num_frames: int, read: ReadVolume) -> Any:
    """Return a layer or a mask, or None, in which `time: auto` is a motion through all steps."""
    volume = part and part.volume
    if isinstance(volume, VolumeSpec) and volume.time == "auto":
        component = 0 if volume.component == "all" else volume.component
        last = read(replace(_first(volume), time=0, component=component)).num_times - 1
        ends = (0.0, float(last)) if volume.interpolate else (0, last)
        part = replace(part, volume=replace(volume, time=moving(Motion((0, max(1, num_frames - 1)), ends))))
    return replace(part, mask=_with_times(part.mask, num_frames, read)) if isinstance(part, LayerSpec) else part


def _with_colors(layer: LayerSpec, read: ReadVolume) -> LayerSpec:
    volume = OverFrames(layer.volume)
    if len(steps_in_time(volume)) > 1:
        found = suggest_in_time(volume, read, NO_WISH)
    else:
        first = volume.at(0)
        found = suggest_read(*read_in_colors(first, read(first), read), NO_WISH)
    shown = replace(layer.volume, component=found.volume.component)
    return replace(layer, volume=shown, transfer_function=found.suggestion.transfer)


def _first(volume: VolumeSpec) -> VolumeSpec:
    """Return a volume as it is on the first frame."""
    return OverFrames(volume).at(0)
