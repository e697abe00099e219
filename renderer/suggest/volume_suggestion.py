"""Suggest how to show a volume that is in memory, with its labels and its colours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

from renderer.looks import linear_in_extinction
from renderer.readers import ReadVolume, are_colors
from renderer.scene import ControlPoint, LayerSpec, Scene, SharedKeys, TransferSpec, VolumeSpec
from renderer.statistics import KnownLabels, Statistics, compute_statistics, label_table_of
from renderer.suggest.suggestion import Suggestion, with_8_bit_colors
from renderer.suggest.value_suggestion import KnowLabels, suggest
from renderer.suggest.wishes import NO_WISH, Wish
from renderer.volume import Volume

_COLORS = "voxels that are colours"
# The control points for voxels that have an alpha: each voxel's opacity is its alpha.
_ALPHA_POINTS = tuple(
    ControlPoint(value, (r, g, b), opacity)
    for value, (r, g, b, opacity) in linear_in_extinction([(0.0, (1.0, 1.0, 1.0, 0.0)), (255.0, (1.0, 1.0, 1.0, 1.0))])
)


@dataclass(frozen=True)
class VolumeSuggestion:
    """A suggestion for a volume whose voxels are no longer in memory.

    volume: the file, and the part of the file that was read.
    suggestion: the suggestion; if all channels are shown, for the first channel.
    has_absent: whether any voxel has no data.
    layers: a layer for each channel if all channels are shown; otherwise empty.
    weight: a factor on the volume's extinction.
    """

    volume: VolumeSpec
    suggestion: Suggestion
    has_absent: bool
    layers: tuple[LayerSpec, ...] = ()
    weight: float = 1.0

    def applied_to(self, scene: Scene) -> Scene:
        """Return a scene with the volume and its suggestion; a scene that has clip planes or `light` keeps them."""
        found, first = self.suggestion, scene.layers[0]
        if self.layers:
            shared = SharedKeys(first.shading, first.mask)
            return replace(scene, layers=tuple(map(shared.added_to, self.layers)), shared=shared, blend="add")
        light = scene.light or found.light
        shading = found.shading if light is None else None
        layer = replace(first, volume=self.volume, transfer_function=found.transfer, shading=shading)
        return replace(scene, layers=(layer,), light=light, clip=scene.clip or found.clip)


def read_in_colors(
    volume: VolumeSpec, found: Volume, read: ReadVolume, wish: Wish = NO_WISH
) -> tuple[VolumeSpec, Volume, Statistics]:
    """Return a volume's description, its voxels and their statistics; voxels that are colours are read as colours.

    If the alpha of colours varies, it gives the opacities. With a user's wish, voxels are read as colours only if
    `volume` says so. found: the volume as it was read first.
    """
    component = volume.component
    if component is None and wish == NO_WISH and are_colors(found.values.dtype, found.channels):
        component = "color"
    if component == "color" and len(found.channels) == 4:
        alpha = read(replace(volume, component="color_alpha"))
        low, high = alpha.value_range()
        if low < high:
            component, found = "color_alpha", alpha
    if component not in (volume.component, "color_alpha"):
        found = read(replace(volume, component=component))
    return replace(volume, component=component), found, compute_statistics(found.values, found.source, may_sample=True)


def suggest_read(
    volume: VolumeSpec, found: Volume, statistics: Statistics, wish: Wish, known: KnowLabels | None = None
) -> VolumeSuggestion:
    """Suggest how to show a volume that is in memory.

    known: returns the labels of all steps in time, and a table of labels; None stands for the labels of this volume,
    and the table in its file or beside it. Raises InputError for a wished preset that cannot be read, or does not suit
    the volume.
    """
    if volume.has_colors:
        suggestion = _color_suggestion(found, statistics, wish)
    else:
        suggestion = suggest(found, statistics, wish, known or partial(_labels_in_table, volume, found))
    if volume.component == "color_alpha" and wish == NO_WISH:
        reason = "of the 4 components the last is alpha, which says how opaque each voxel is"
        suggestion = Suggestion(_COLORS, reason, TransferSpec(_ALPHA_POINTS), (), None)
    if statistics.is_of_sample:
        counted = f"counted on {statistics.num_counted} of {statistics.num_voxels} voxels"
        suggestion = replace(suggestion, reason=f"{suggestion.reason}; {counted}")
    return VolumeSuggestion(volume, with_8_bit_colors(suggestion), found.num_absent > 0)


def _labels_in_table(spec: VolumeSpec, volume: Volume) -> KnownLabels:
    return KnownLabels((), {label.value: label for label in label_table_of(spec, volume)})


def _color_suggestion(volume: Volume, statistics: Statistics, wish: Wish) -> Suggestion:
    """Return a suggestion for voxels that are colours: opacities depend on luminance.

    The colours of a preset that the user wishes for are multiplied by the colours of the voxels.
    """
    found = suggest(volume, statistics, Wish(wish.colormap, wish.preset or "surface"))
    transfer = found.transfer
    if wish == NO_WISH and transfer.points:
        white = tuple(replace(point, color=(1.0, 1.0, 1.0)) for point in transfer.points)
        transfer = replace(transfer, mapping=white)
    reason = f"{len(volume.channels)} components, and opacities go with luminance"
    shading = found.shading and replace(found.shading, specular=0.0)
    return replace(found, kind=_COLORS, reason=reason, transfer=transfer, shading=shading)
