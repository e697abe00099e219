"""Tell where volumes lie beside each other in the world, and refuse those whose worlds do not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from renderer.errors import Problem
from renderer.scene import LayerSpec, format_value
from renderer.volume import Float64, Volume

# Half the diagonals of two volumes in one world differ by less: a body has 300 times the length of a vessel wall.
_MAX_SIZE_RATIO = 300.0


def reach_text(volume: Volume) -> str:
    """Return from where to where in the world a volume reaches, in words."""
    low, high = (format_value([float(f"{at:.6g}") for at in corner]) for corner in _world_box(volume))
    return f"from {low} to {high}"


def placement_problems(volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield the volumes that are far larger or far smaller than the first one: those in other units of length."""
    for number, volume in enumerate(volumes):
        ratio = volume.half_diagonal / volumes[0].half_diagonal
        if not 1 / _MAX_SIZE_RATIO <= ratio <= _MAX_SIZE_RATIO:
            what = (
                f"this volume is {max(ratio, 1 / ratio):.3g} times as {'large' if ratio > 1 else 'small'} as the first"
            )
            got = f"it reaches {reach_text(volume)}, the first {reach_text(volumes[0])}"
            hint = "are there metres beside millimetres? `spacing` gives the lengths of a voxel"
            yield Problem(f"volumes.{number}", what, got, f"at most {_MAX_SIZE_RATIO:g} times", hint)


def placement_notes(layers: Sequence[LayerSpec], volumes: Sequence[Volume]) -> Iterator[str]:
    """Yield a sentence on each of several volumes that overlaps no other."""
    lows, highs = np.array([_world_box(volume) for volume in volumes]).swapaxes(0, 1)
    overlaps = ((lows[:, None] < highs) & (lows < highs[:, None])).all(axis=2)
    for layer, volume, num in zip(layers, volumes, overlaps.sum(axis=1).tolist(), strict=True):
        if num == 1 < len(volumes):  # itself
            yield f"{layer.name or volume.name} overlaps no other volume: it reaches {reach_text(volume)}"


def _world_box(volume: Volume) -> tuple[Float64, Float64]:
    """Return the lowest and the highest corner of the box around a volume, along the axes of the world."""
    reach = np.abs(volume.world_from_index[:3, :3]) @ volume.shape_xyz / 2
    return volume.centre - reach, volume.centre + reach
