"""Tell where volumes lie beside each other in the world, and refuse those whose worlds do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from renderer.errors import Problem
from renderer.scene import LayerSpec, format_value
from renderer.volume import Float64, Volume

# Half the diagonals of two volumes in one world differ by less: a body has 300 times the length of a vessel wall.
_MAX_SIZE_RATIO = 300.0


def reach_text(volume: Volume) -> str:
    """Return from where to where in the world a volume reaches, in words."""
    low, high = (format_value(corner.tolist()) for corner in _world_box(volume))
    return f"from {low} to {high}"


def placement_problems(volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield the volumes that are far larger or far smaller than the first one: those in other units of length."""
    for number, volume in enumerate(volumes):
        ratio = volume.half_diagonal / volumes[0].half_diagonal
        if max(ratio, 1 / ratio) > _MAX_SIZE_RATIO:
            what = (
                f"this volume is {max(ratio, 1 / ratio):.3g} times as {'large' if ratio > 1 else 'small'} as the first"
            )
            got = f"{volume.name} reaches {reach_text(volume)}, {volumes[0].name} {reach_text(volumes[0])}"
            hint = "are there metres beside millimetres? `spacing` gives the lengths of a voxel"
            yield Problem(f"volumes.{number}", what, got, f"at most {_MAX_SIZE_RATIO:g} times", hint)


def placement_notes(layers: Sequence[LayerSpec], volumes: Sequence[Volume]) -> list[str]:
    """Return a sentence on each of several volumes that overlaps no other."""
    overlapping: set[int] = set()
    for pair in combinations(range(len(volumes)), 2):
        (low, high), (other_low, other_high) = (_world_box(volumes[number]) for number in pair)
        if (low < other_high).all() and (other_low < high).all():
            overlapping.update(pair)
    return [
        f"{layer.name or volume.name} overlaps no other volume: it reaches {reach_text(volume)}"
        for number, (layer, volume) in enumerate(zip(layers, volumes, strict=True))
        if number not in overlapping and len(volumes) > 1
    ]


def _world_box(volume: Volume) -> tuple[Float64, Float64]:
    """Return the lowest and the highest corner of the box around a volume, along the axes of the world."""
    reach = np.abs(volume.world_from_index[:3, :3]) @ volume.shape_xyz / 2
    return volume.centre - reach, volume.centre + reach
