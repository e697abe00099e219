"""Suggest a transfer function for a volume that is still to be read, and choose what stands for NaN and infinities."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from renderer.scene import ColormapSpec, VolumeSpec, raise_problems, volume_extent, volume_problems
from renderer.suggest.histogram import compute_statistics
from renderer.suggest.suggestion import NO_WISH, Suggestion, suggest, suggest_nonfinite_fill
from renderer.suggest.wishes import Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Volume


@dataclass(frozen=True)
class VolumeSuggestion:
    """A suggestion for a volume whose voxels are no longer in memory.

    volume: which voxels, and what stands for NaN and infinities. is_float: whether its dtype has NaN and infinities.
    nonfinite: how many voxels are NaN or infinite, and what is drawn for them; None if every voxel is finite.
    """

    volume: VolumeSpec
    suggestion: Suggestion
    is_float: bool
    nonfinite: str | None = None


def suggest_for(
    volume: VolumeSpec,
    read: Callable[[VolumeSpec], Volume],
    *,
    wish: Wish = NO_WISH,
    hides_nonfinite: bool = True,
) -> VolumeSuggestion:
    """Read a volume and suggest how to show it.

    read: reads the voxels, perhaps twice.
    hides_nonfinite: if `volume` asks for the `lowest` value for NaN and infinities, and another value is less visible,
        take that one.
    Raises InputError for a volume that cannot be read or drawn, and as `suggest`.
    """
    result, fill, is_seen = _attempt(volume, read, wish)
    if hides_nonfinite and fill is not None:
        other, _, is_other_seen = _attempt(replace(volume, nonfinite=fill), read, wish)
        # The fill value changes the volume, so it may show after all.
        if is_seen or not is_other_seen:
            return other
    return result


def _attempt(
    spec: VolumeSpec, read: Callable[[VolumeSpec], Volume], wish: Wish
) -> tuple[VolumeSuggestion, float | None, bool]:
    """Return a suggestion for one fill value, the value to try next, if any, and whether the present one is visible."""
    volume = read(spec)
    raise_problems(volume_problems(volume_extent(volume), volume.name))
    statistics = compute_statistics(volume.values, volume.source)
    suggestion = _with_8_bit_colors(suggest(volume, statistics, wish))
    is_float = volume.values.dtype.kind == "f"
    if not volume.num_nonfinite:
        return VolumeSuggestion(spec, suggestion, is_float), None, False
    transfer = make_transfer_function(suggestion.transfer, volume.finest_spacing)
    is_seen = bool(transfer.classify(np.array([volume.nonfinite_fill_value]))[1][0] > 0)
    fill = suggest_nonfinite_fill(volume, statistics) if spec.nonfinite == "lowest" else None
    note = (
        f"{volume.num_nonfinite} of {volume.values.size} voxels are NaN or infinite; they are drawn as "
        f"{'the lowest value, ' if spec.nonfinite == 'lowest' else ''}{volume.nonfinite_fill_value:.7g}, which "
        f"{'can be seen' if is_seen else 'is not seen'}"
    )
    return VolumeSuggestion(spec, suggestion, is_float, note), fill, is_seen


def _with_8_bit_colors(suggestion: Suggestion) -> Suggestion:
    """Round the colours to `#rrggbb`, as a scene file has them, so that both draw the same."""
    mapping = suggestion.transfer.mapping
    if isinstance(mapping, ColormapSpec):
        return suggestion
    points = []
    for point in mapping:
        red, green, blue = (round(255 * part) / 255 for part in point.color)
        points.append(replace(point, color=(red, green, blue)))
    return replace(suggestion, transfer=replace(suggestion.transfer, mapping=tuple(points)))
