"""Replace the percentiles of a transfer function by values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from renderer.errors import Problem
from renderer.readers import ReadVolume
from renderer.scene import (
    TRANSFER_FUNCTION_SECTION,
    LayerSpec,
    OverFrames,
    format_value,
    map_values,
    schema,
    spec_to_dict,
)
from renderer.statistics import exact_percentiles

_HINT = "many voxels have the same value; take percentiles that differ: `hsplat info` shows some"


def with_values(layer: LayerSpec, place: str, read: ReadVolume, problems: list[Problem]) -> LayerSpec:
    """Return a layer in whose transfer function values replace the percentiles.

    The values are the percentiles of the volume at the first frame. place: the position of the transfer function in the
    scene. problems: a list to which this adds problems with the values, such as percentiles with the same value. Raises
    InputError for a volume that cannot be read.
    """
    transfer = layer.transfer_function
    if not transfer.relative:
        return layer
    percents = dict[float, None]()
    map_values(transfer, lambda percent: percents.setdefault(percent, None) or percent)
    volume = read(OverFrames(layer.volume).at(0))
    name = Path(volume.name).name
    found = exact_percentiles(volume.values, volume.source, [*percents])
    plain = map_values(transfer, lambda percent: float(found[percent]))
    if len(found) > 1 and len({*found.values()}) == 1:
        what, got = f"these percentiles of {name} are one value", format_value(next(iter(found.values())))
        problems.append(Problem(place, what, got, "percentiles of different values", _HINT))
        return replace(layer, transfer_function=plain)
    # Values that replace percentiles are checked like values that a scene gives.
    wrong = list[Problem]()
    for frame in (None, 0):
        film = schema.FilmTime(None, 1.0, frame)
        TRANSFER_FUNCTION_SECTION.read(schema.TreeNode(spec_to_dict(plain), place, wrong, film=film))
    wrong = list(dict.fromkeys(wrong))
    problems += [replace(each, what=f"{each.what}, with values of {name}", hint=each.hint or _HINT) for each in wrong]
    return replace(layer, transfer_function=plain)
