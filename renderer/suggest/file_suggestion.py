"""Suggest how to show a volume that is still to be read, with all of its channels and steps in time."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from renderer.readers import ReadVolume
from renderer.scene import (
    OPEN_LOOK,
    LayerSpec,
    Motion,
    OverFrames,
    VolumeSpec,
    counted,
    moving,
    raise_problems,
    volume_extent,
    volume_problems,
)
from renderer.suggest.channels import channel_layers
from renderer.suggest.looks_in_time import suggest_in_time
from renderer.suggest.suggestion import Suggestion
from renderer.suggest.volume_suggestion import VolumeSuggestion, read_in_colors, suggest_read
from renderer.suggest.wishes import NO_WISH, Wish
from renderer.volume import Volume


def suggest_for(volume: VolumeSpec, read: ReadVolume, *, wish: Wish = NO_WISH) -> VolumeSuggestion:
    """Read a volume and suggest how to show it.

    read: reads the voxels of one channel at one step in time, with a list of all channels. Of a long time series, only
    some steps are read. Raises InputError for a volume that cannot be read or drawn, and for a wished preset that
    cannot be read or does not suit the volume.
    """
    may_have_channels = wish == NO_WISH and volume.component in (None, "all")
    asked: int | Literal["all"] | None = 0 if volume.component == "all" else "all"
    found = read(replace(volume, component=asked) if may_have_channels else volume)
    if found.labels and found.channels and volume.component is None:  # channels that hold labels are read as one volume
        found = read(volume)
    raise_problems(volume_problems(volume_extent(found), found.name))
    num_times = found.num_times if volume.time is None else 1
    last = num_times - 1
    in_time = replace(volume, time=moving(Motion((0, last), (0, last)))) if last else volume
    if may_have_channels and (volume.component == "all" or any(channel.is_light for channel in found.channels)):
        suggested = _channels_suggestion(in_time, found, read)
    elif last:
        suggested = suggest_in_time(OverFrames(in_time), read, wish)
    else:
        return suggest_read(*read_in_colors(volume, found, read, wish), wish)
    return _with_all_times(suggested) if last else suggested


def _with_all_times(found: VolumeSuggestion) -> VolumeSuggestion:
    layers = tuple(replace(layer, volume=replace(layer.volume, time="auto")) for layer in found.layers)
    return replace(found, volume=replace(found.volume, time="auto"), layers=layers)


def _channels_suggestion(volume: VolumeSpec, first: Volume, read: ReadVolume) -> VolumeSuggestion:
    layers = channel_layers(LayerSpec(volume, OPEN_LOOK), first, read)
    reason = "each is shown in a colour of its own, and their light adds up"
    suggestion = Suggestion(counted(len(layers), "channel"), reason, layers[0].transfer_function, (), None)
    return VolumeSuggestion(volume, suggestion, first.num_absent > 0, tuple(layers))
