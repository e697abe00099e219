"""Find the names, colours and windows of the channels of a TIFF file, as ImageJ and OME write them.

OME has a name and a colour for each channel. ImageJ has a window, the labels of the planes, and a table of 256 colours.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from renderer.readers.components import MAX_LISTED
from renderer.readers.tiff_description import Layout, Page, is_imagej, is_ome, ome_elements
from renderer.readers.tiff_statements import sample_names
from renderer.system import attribute, number_in, unescaped
from renderer.volume import Channel

# The largest number of characters of a channel's name. Further characters are cut off.
_MAX_NAME = 60


def find_channels(first: Page, layout: Layout, channels: tuple[Channel, ...]) -> tuple[Channel, ...]:
    """Return the channels of a file with their names, colours and windows; samples of colour pictures are not light.

    first: the first page. channels: the channels before this file's description is read. Colours by which channels
    cannot be distinguished, such as white for all or black for one, are left out.
    """
    count = len(channels)
    if sample_names(first) or count < 2:
        return tuple(replace(each, is_light=False) for each in channels)
    if is_ome(first.description) and count <= MAX_LISTED:
        channels = _of_ome(first.description, count)
    elif is_imagej(first.description) and layout.count("C") == count <= MAX_LISTED:
        channels = _of_imagej(first.parent.imagej_metadata or {}, layout, count)
    tell_apart = len({each.color for each in channels}) == count and all(any(each.color or (1,)) for each in channels)
    return tuple(replace(each, color=each.color if tell_apart else None, is_light=True) for each in channels)


def _of_ome(description: str, count: int) -> tuple[Channel, ...]:
    elements = ome_elements(description, "Channel")
    if len(elements) != count:
        return (Channel(),) * count
    colors = [attribute(element, "Color") or "" for element in elements]
    return tuple(
        Channel(_text(attribute(element, "Name")), _ome_color(color))
        for element, color in zip(elements, colors, strict=True)
    )


def _ome_color(text: str) -> tuple[float, float, float] | None:
    """Return the colour in OME's signed number of 32 bits: red, green, blue and alpha; None for any other text."""
    number = number_in(text)
    if not -(2**31) <= number < 2**32:
        return None
    red, green, blue, _ = (int(number) % 2**32).to_bytes(4, "big")
    return red / 255, green / 255, blue / 255


def _of_imagej(fields: dict[str, Any], layout: Layout, count: int) -> tuple[Channel, ...]:
    """Return the channels that ImageJ describes; the labels of some planes may be missing.

    fields: ImageJ's fields, by the names that tifffile gives them. count: the number of channels.
    """
    windows, tables = np.ravel(fields.get("Ranges", ())).tolist(), fields.get("LUTs", ())
    labels = [str(label) for label in fields.get("Labels", ())]
    planes = np.moveaxis(np.arange(np.prod(layout.counts)).reshape(layout.counts), layout.axes.find("C"), 0)
    channels = []
    for number, own in enumerate(planes.reshape(count, -1).tolist()):
        named = {labels[plane] for plane in own if plane < len(labels)}
        pair = windows[2 * number : 2 * number + 2]
        table = np.asarray(tables[number], np.float64) if number < len(tables) else np.empty((0, 1))
        brightest = np.ravel(table[:3, -1] / 255).tolist()
        color = (brightest[0], brightest[1], brightest[2]) if len(brightest) == 3 else None
        window = (pair[0], pair[1]) if len(pair) == 2 and pair[0] < pair[1] else None
        channels.append(Channel(_text(named.pop()) if len(named) == 1 else "", color, window))
    return tuple(channels)


def _text(text: str | None) -> str:
    return " ".join(unescaped(text or "").split())[:_MAX_NAME]
