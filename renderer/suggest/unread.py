"""Suggest how to show a volume that is still to be read: all of its channels, and all of its steps in time.

A look of one step may show nothing of the others, or the air of one. Some steps are read. Each look of one is tried on
all, along the same rays, also without the values that are background in any step, and the one that suits most is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from renderer.readers import some_steps
from renderer.scene import (
    OF_CHANNELS,
    ColormapSpec,
    LabelsSpec,
    LayerSpec,
    Motion,
    OverFrames,
    VolumeSpec,
    counted,
    moving,
    raise_problems,
    steps_in_time,
    volume_extent,
    volume_problems,
)
from renderer.suggest import features
from renderer.suggest.channels import ReadVolume, channel_layers
from renderer.suggest.features import Background, VoxelSample
from renderer.suggest.histogram import Statistics
from renderer.suggest.label_choice import known_labels
from renderer.suggest.opacity_calibration import TurntableRays, cast_rays, depths_along
from renderer.suggest.padding import without_padding
from renderer.suggest.suggestion import LEAST_OPACITY, Suggestion, transparent_between, with_points
from renderer.suggest.volume_suggestion import NO_WISH, VolumeSuggestion, read_in_colors, suggest_read
from renderer.suggest.wishes import Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Float64, Volume

# A look that shows less than this part of what a step's own look shows of it does not suit the step.
_LEAST_SHOWN = 0.1
# Nor does one that shows so much more of the border, where its air is, than its own look does.
_MOST_AIR = 0.02
# A step of which less than this part of the most visible one is seen shows next to nothing.
_NEXT_TO_NOTHING = 0.05


def suggest_for(volume: VolumeSpec, read: ReadVolume, *, wish: Wish = NO_WISH) -> VolumeSuggestion:
    """Read a volume and suggest how to show it.

    read: reads the voxels; of several channels first those of one, which tells of all; of several steps in time some.
    Raises InputError for a volume that cannot be read or drawn, and as `suggest`.
    """
    may_have_channels = wish == NO_WISH and volume.component in (None, "all")
    asked: int | Literal["all"] | None = 0 if volume.component == "all" else "all"
    found = read(replace(volume, component=asked) if may_have_channels else volume)
    if found.labels and found.channels and volume.component is None:  # layers of segments, which are one volume
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
    layers = channel_layers(LayerSpec(volume, OF_CHANNELS), first, read)
    reason = "each is shown in a colour of its own, and their light adds up"
    suggestion = Suggestion(counted(len(layers), "channel"), reason, layers[0].transfer_function, (), None)
    return VolumeSuggestion(volume, suggestion, first.num_absent > 0, tuple(layers))


# Steps in time


@dataclass(frozen=True)
class _Step:
    """A step in time: the look that is suggested for it, and the measurements by which other looks suit it or not.

    number: of the step. span: of its values. sample: tells how values are normalised; it has no voxels.
    border: the values on its faces. background: its own, normalised.
    """

    number: int
    found: VolumeSuggestion
    span: float
    rays: TurntableRays
    sample: VoxelSample
    border: Float64
    background: Background

    def shown(self, look: Suggestion) -> float:
        """Return the mean opacity of rays that meet the volume."""
        depths = depths_along(look.transfer, self.sample, self.rays, self.sample.diagonal).sum(axis=1)
        return float(-np.expm1(-depths.astype(np.float64)).mean())

    def air_shown(self, look: Suggestion) -> float:
        """Return the part of the voxels on the faces that is visible."""
        transfer = make_transfer_function(look.transfer, min(self.sample.spacing))
        return float(np.mean(transfer.classify(self.border)[1] * transfer.unit > LEAST_OPACITY))


def suggest_in_time(volume: OverFrames[VolumeSpec], read: ReadVolume, wish: Wish) -> VolumeSuggestion:
    """Suggest how to show the steps of a volume whose time moves: a look that suits as many of some as possible."""
    all_steps = steps_in_time(volume)
    steps = [_look_at(all_steps[k], read, wish) for k in some_steps(len(all_steps))]
    widest = max(steps, key=lambda step: step.span)
    if widest.found.suggestion.transfer.labels is not None:
        spec, labels, statistics = _read(replace(volume.at(0), time=widest.number), read, wish)
        of_all = volume.map(lambda each: replace(spec, time=each.time))
        known = partial(known_labels, of_all, read, LabelsSpec())
        return suggest_read(spec, labels, statistics, wish, known)
    chosen, look = _most_suitable(steps, widest)
    which, num = f"step {chosen.number} of {len(all_steps)}", len(steps)
    why = f"{which} has the widest range of {num} that were read"
    if chosen is not widest:
        why = f"the look is that of {which}, which suits most of {num} that were read"
    shown = {step.number: step.shown(look) for step in steps}
    dim = [str(number) for number, part in shown.items() if part < _NEXT_TO_NOTHING * max(shown.values())]
    note = f"{_counted_steps(dim)} of {len(all_steps)} {'shows' if len(dim) == 1 else 'show'} next to nothing"
    notes = (*look.outlier_notes, *[f"{note} with this look"] * bool(dim))
    return replace(chosen.found, suggestion=replace(look, reason=f"{look.reason}; {why}", outlier_notes=notes))


def _counted_steps(numbers: Sequence[str]) -> str:
    """Return `step 3`, or `steps 0, 3 and 7`."""
    *others, last = numbers or [""]
    return f"steps {', '.join(others)} and {last}" if others else f"step {last}"


def _read(spec: VolumeSpec, read: ReadVolume, wish: Wish) -> tuple[VolumeSpec, Volume, Statistics]:
    return read_in_colors(spec, read(spec), read, wish)


def _look_at(spec: VolumeSpec, read: ReadVolume, wish: Wish) -> _Step:
    number = spec.time
    assert isinstance(number, int)
    spec, volume, statistics = _read(spec, read, wish)
    found = suggest_read(spec, volume, statistics, wish)
    shown = statistics.without_outliers or statistics
    if shown.minimum == shown.maximum:  # a sample needs a range
        shown = replace(shown, minimum=shown.minimum - max(1, abs(shown.minimum)))
    sample = without_padding(features.sample_volume(volume, shown))
    span, (border, _), empty = sample.maximum - sample.minimum, sample.valid_values(), np.empty((0, 0, 0))
    return _Step(
        number=number,
        found=found,
        span=span,
        rays=cast_rays(sample),
        sample=replace(sample, normalized=empty, neighbours=empty, is_valid=empty > 0),
        border=sample.minimum + span * border,
        background=features.find_background(sample),
    )


def _most_suitable(steps: Sequence[_Step], widest: _Step) -> tuple[_Step, Suggestion]:
    """Return the step whose look suits most of some steps, and the look; of equal ones the first, of the widest range.

    Steps without a background do not count, for nothing tells what stands out in them.
    """
    backed = [step for step in steps if step.background.is_there]
    own = [(step.shown(step.found.suggestion), step.air_shown(step.found.suggestion)) for step in backed]

    def num_unsuited(look: Suggestion) -> tuple[int, int]:
        pairs = [*zip(backed, own, strict=True)]
        num_airy = sum(step.air_shown(look) > air + _MOST_AIR for step, (_, air) in pairs)
        return num_airy, sum(step.shown(look) < _LEAST_SHOWN * shown for step, (shown, _) in pairs)

    tried = [widest, *(step for step in backed if step is not widest)]
    looks = [(step, look) for step in tried for look in _looks_of(step, backed)]
    return min(looks, key=lambda pair: num_unsuited(pair[1]))


def _looks_of(step: _Step, backed: Sequence[_Step]) -> Iterator[Suggestion]:
    """Yield the look of a step, and the same look without the values that are background in any step."""
    look = step.found.suggestion
    yield look
    if look.transfer.points and not isinstance(look.transfer.mapping, ColormapSpec) and backed:
        ends = [
            (each.sample.denormalize(ground.low), each.sample.denormalize(ground.high))
            for each in backed
            for ground in [each.background]
        ]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        yield with_points(look, transparent_between(look.transfer.points, low, high))
