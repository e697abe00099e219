"""Make a layer of each channel of a volume. Its name, colour and value range come from the file, or are suggested."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from renderer.errors import InputError
from renderer.readers import ReadVolume, some_steps
from renderer.scene import RAMP_THICKNESS, Color, LayerSpec, OverFrames, ramp, steps_in_time
from renderer.statistics import compute_statistics, find_background, sample_volume, without_padding
from renderer.suggest.palette import in_8_bits
from renderer.volume import Channel, Volume

# The colours of channels whose file gives no colour, used in turn. People who cannot tell red from green can tell the
# first two apart.
_COLORS: tuple[Color, ...] = (
    (0.0, 1.0, 0.0),
    (1.0, 0.0, 1.0),
    (0.0, 1.0, 1.0),
    (1.0, 1.0, 0.0),
    (1.0, 0.0, 0.0),
    (0.0, 0.0, 1.0),
    (1.0, 0.5, 0.0),
    (1.0, 1.0, 1.0),
)
# The largest number of channels of a volume; a volume with more channels is an error.
_MAX_CHANNELS = 64
# A channel has its full colour from this percentile of the values above its background on.
_BRIGHT_PERCENTILE = 99.0
# A channel without a background, such as tissue that fills the volume, gives no light up to this percentile of its
# values: the light of lower values would add up to white.
_DARK_PERCENTILE = 80.0
# The weight of a channel follows from the light along rays through a coarser grid of voxels: every second voxel from
# twice this number of voxels on an axis on, every third from three times this number on, and so forth.
_SAMPLED_SIDE = 96
# A ray through a channel counts as bright if its light is more than this part of the light of the brightest ray.
_LEAST_BRIGHT = 0.1
# The weight of a channel makes this percentile of the light of its bright rays the full brightness.
_FULL_PERCENTILE = 93.0
# The largest weight that is suggested for a channel; the smallest weight is the reciprocal of this number.
_MOST_WEIGHT = 50.0


def channel_layers(
    layer: LayerSpec, first: Volume, read: ReadVolume, *, num_before: int | None = None
) -> list[LayerSpec]:
    """Return a layer for each channel of a volume, without those that the file hides, if it shows any.

    A given transfer function applies to all of them.

    layer: a layer of a film, whose values may move. first: the voxels of the first channel, or of a volume without
    channels. read: reads the voxels of another channel. num_before: the number of channels of earlier volumes in the
    list, which have the first colours; None for the only volume of a scene, of which a single channel is white.
    """
    channels, made = first.channels or (Channel(color=(1.0, 1.0, 1.0) if num_before is None else None),), []
    if len(channels) > _MAX_CHANNELS:
        what, expected = "this volume has too many components to show all", f"at most {_MAX_CHANNELS}"
        raise InputError(what, where=first.name, got="component: all", expected=expected)
    are_all_hidden = all(channel.is_hidden for channel in channels)
    for number, channel in enumerate(channels):
        if channel.is_hidden and not are_all_hidden:
            continue
        spec = replace(layer.volume, component=number)
        number_text = str(number + 1) if layer.name and len(channels) > 1 else ""
        name = " ".join(filter(None, (layer.name, channel.name or number_text)))
        own = replace(layer, volume=spec, name=name)
        if layer.transfer_function.is_open:
            every = steps_in_time(OverFrames(spec))
            steps = [every[k] for k in some_steps(len(every))]
            volumes = [first] if number == 0 and len(steps) == 1 else map(read, steps)
            own = channel_with_look(own, (num_before or 0) + number, channel, volumes)
        made.append(own)
    return list(with_own_names(made))


def channel_with_look(layer: LayerSpec, number: int, channel: Channel, steps: Iterable[Volume]) -> LayerSpec:
    """Return the layer of a channel with a colour, a range of values and, unless it has one, a weight.

    number: the number of the channel among all channels of the list. steps: the channel at some steps in time.
    """
    window, brightest = _common_window(steps)
    window = channel.window or window
    color = in_8_bits(channel.color or _COLORS[number % len(_COLORS)])
    made = replace(layer, transfer_function=ramp(color, window), color=color, range=window)
    return replace(made, weight=suggest_weight(brightest, window)) if layer.weight == 1.0 else made


def _common_window(steps: Iterable[Volume]) -> tuple[tuple[float, float], Volume]:
    """Return the range of values between no light and full colour for all steps in time, and the brightest step.

    steps: one channel at some steps in time. Each end of the range is the highest of any step. The brightest step is
    the step whose range has the highest upper end.
    """
    (low, high), brightest = (-math.inf, -math.inf), None
    for volume in steps:
        window = suggest_window(volume)
        brightest = volume if brightest is None or window[1] > high else brightest
        low, high = max(low, window[0]), max(high, window[1])
    assert brightest is not None, "there is a step"
    return (low, high), brightest


def suggest_window(volume: Volume) -> tuple[float, float]:
    """Return the lowest value of a channel that gives light, and the value from which on it has its full colour."""
    statistics = compute_statistics(volume.values, volume.source, may_sample=True)
    shown = statistics.without_outliers or statistics
    if shown.minimum == shown.maximum:
        return float(shown.minimum), float(shown.minimum) + max(1.0, abs(shown.minimum))
    sample = without_padding(sample_volume(volume, shown))
    background, values = find_background(sample), sample.normalized[sample.is_valid]
    low = background.high if background.is_there else float(np.percentile(values, _DARK_PERCENTILE))
    above = values[values > low]
    high = max(float(np.percentile(above, _BRIGHT_PERCENTILE)) if above.size else 1.0, low + 0.01)
    return sample.round_value(sample.denormalize(low)), sample.round_value(sample.denormalize(high))


def suggest_weight(volume: Volume, window: tuple[float, float]) -> float:
    """Return the weight of a channel, to two digits, with which bright rays along the axes are about fully bright.

    window: the values of no light and of full colour.
    """
    steps = [max(1, num // _SAMPLED_SIDE) for num in volume.values.shape]
    sampled = volume.values[tuple(slice(None, None, step) for step in steps)].astype(np.float64)
    low, high = window
    shares = np.clip((np.nan_to_num(sampled, nan=low) / 2 - low / 2) / (high / 2 - low / 2), 0, 1)
    lengths = volume.spacing[::-1] * steps / (RAMP_THICKNESS * float((volume.spacing * volume.shape_xyz).max()))
    depths = np.concatenate([(shares.sum(axis) * lengths[axis]).ravel() for axis in range(3)])
    bright = depths[depths > _LEAST_BRIGHT * depths.max()]
    if not bright.size:
        return 1.0
    weight = 1 / float(np.percentile(bright, _FULL_PERCENTILE))
    return float(f"{min(max(weight, 1 / _MOST_WEIGHT), _MOST_WEIGHT):.2g}")


def with_own_names(layers: list[LayerSpec]) -> Iterator[LayerSpec]:
    """Yield the layers with different names: if an earlier layer has the same name, the layer's number is added."""
    names: list[str] = []
    for number, layer in enumerate(layers, 1):
        name = f"{layer.name} ({number})" if layer.name and layer.name in names else layer.name
        names.append(name)
        yield replace(layer, name=name)
