"""Suggest how to show several volumes in one picture: as channels, and labels over a scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from renderer.readers import ReadVolume
from renderer.scene import LayerSpec
from renderer.suggest.channels import channel_with_look
from renderer.suggest.file_suggestion import suggest_for
from renderer.suggest.over import suggest_over
from renderer.suggest.volume_suggestion import VolumeSuggestion
from renderer.suggest.wishes import LABELS_WISH, NO_WISH, Wish
from renderer.volume import Channel

_LABELS = Wish(preset=LABELS_WISH)


def suggest_several(layers: Sequence[LayerSpec], wishes: Sequence[Wish | None], read: ReadVolume) -> list[LayerSpec]:
    """Return layers with suggested looks.

    Labels over a scan make the scan a translucent shell. Otherwise each volume without a look becomes a channel, whose
    light is of a colour of its own.

    wishes: for each layer, the wish of a user; None for a layer that has its look, or shows labels. Labels keep their
    colours and names, and are lit. Raises InputError as `suggest_for`.
    """
    are_labels = [layer.transfer_function.labels is not None for layer in layers]
    if len(layers) == 2 and are_labels.count(True) == 1:
        number = are_labels.index(True)
        if (wish := wishes[1 - number]) is not None:
            upper, lower = layers[number], layers[1 - number]
            found = suggest_over(upper.volume, lower.volume, read, wish=_LABELS, under_wish=wish)
            made = [_with_look(upper, found[0]), _with_look(lower, found[1])]
            return made if number == 0 else made[::-1]
    made, num_channels = [], 0
    for layer, wish, shows_labels in zip(layers, wishes, are_labels, strict=True):
        if wish == NO_WISH:
            made.append(channel_with_look(layer, num_channels, Channel(), [read(layer.volume)]))
            num_channels += 1
        elif wish is not None or shows_labels:
            made.append(_with_look(layer, suggest_for(layer.volume, read, wish=wish or _LABELS)))
        else:
            made.append(layer)
    return made


def _with_look(layer: LayerSpec, found: VolumeSuggestion) -> LayerSpec:
    """Return a layer with its suggested look; labels keep their colours and names."""
    suggestion = found.suggestion
    has_labels = layer.transfer_function.labels is not None
    transfer = layer.transfer_function if has_labels else suggestion.transfer
    clip = tuple(each for each in suggestion.clip if each.plane is not None)
    volume, weight = found.volume, found.weight
    return replace(
        layer, volume=volume, transfer_function=transfer, shading=suggestion.shading, clip=clip, weight=weight
    )
