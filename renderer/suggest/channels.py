"""Make a layer of each channel of a volume: name, colour and window are the file's, or else suggested."""

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

# The colours of channels without one, in turn. People who see no difference of red and green tell the
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
# The most channels.
_MAX_CHANNELS = 64
# The percentile of the values above the background that has the full colour.
_BRIGHT_PERCENTILE = 99.0
# The percentile that is dark where no background stands apart, as in tissue that fills the picture: there the light of
# lower values would burn it out.
_DARK_PERCENTILE = 80.0
# The most voxels along each axis whose light is summed up.
_SAMPLED_SIDE = 96
# The least light of a bright ray, as a part of the most light.
_LEAST_BRIGHT = 0.1
# The percentile of the bright rays that is fully bright.
_FULL_PERCENTILE = 93.0
# The largest weight, and one over the smallest.
_MOST_WEIGHT = 50.0


def channel_layers(layer: LayerSpec, first: Volume, read: ReadVolume) -> list[LayerSpec]:
    """Return a layer for each channel of a volume; a transfer function that is given is for all of them.

    layer: of a film, in which values may move. first: the first channel, or the volume if that has no others.
    read: reads the voxels of others.
    """
    channels, made = first.channels or (Channel(color=(1.0, 1.0, 1.0)),), []
    if len(channels) > _MAX_CHANNELS:
        what, expected = "this volume has too many components to show all", f"at most {_MAX_CHANNELS}"
        raise InputError(what, where=first.name, got="component: all", expected=expected)
    for number, channel in enumerate(channels):
        spec = replace(layer.volume, component=number)
        name = " ".join(filter(None, (layer.name, channel.name or (f"{number + 1}" if layer.name else ""))))
        own = replace(layer, volume=spec, name=name)
        if layer.transfer_function.is_open:
            every = steps_in_time(OverFrames(spec))
            steps = [every[k] for k in some_steps(len(every))]
            volumes = [first] if number == 0 and len(steps) == 1 else map(read, steps)
            window, brightest = _common_window(volumes)
            window = channel.window or window
            color = in_8_bits(channel.color or _COLORS[number % len(_COLORS)])
            own = replace(own, transfer_function=ramp(color, window), color=color, range=window)
            if layer.weight == 1.0:
                own = replace(own, weight=suggest_weight(brightest, window))
        made.append(own)
    return list(with_own_names(made))


def _common_window(steps: Iterable[Volume]) -> tuple[tuple[float, float], Volume]:
    """Return the values of a channel that are shown as nothing and as its full colour, by some of its steps in time.

    They are the highest of any step. Returns the brightest step, too.
    """
    (low, high), brightest = (-math.inf, -math.inf), None
    for volume in steps:
        window = suggest_window(volume)
        brightest = volume if brightest is None or window[1] > high else brightest
        low, high = max(low, window[0]), max(high, window[1])
    assert brightest is not None, "there is a step"
    return (low, high), brightest


def suggest_window(volume: Volume) -> tuple[float, float]:
    """Return the values of a channel that are shown as nothing and as its full colour."""
    statistics = compute_statistics(volume.values, volume.source)
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
    """Return the weight, of two digits, with which the light of bright rays along the axes is about full."""
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
    """Yield layers in which a name that others have, too, has a number."""
    names: list[str] = []
    for number, layer in enumerate(layers, 1):
        name = f"{layer.name} ({number})" if layer.name and layer.name in names else layer.name
        names.append(name)
        yield replace(layer, name=name)
