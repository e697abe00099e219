"""Suggest a look for all steps in time of a volume.

A look of one step may show nothing of the others, or the air of one. Some steps are read. Each look of one is tried on
all, along the same rays, also without the values that are background in any step, and the one that suits most is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from renderer.readers import ReadVolume, some_steps
from renderer.scene import ColormapSpec, LabelsSpec, OverFrames, VolumeSpec, steps_in_time
from renderer.statistics import (
    Background,
    Statistics,
    VoxelSample,
    find_background,
    read_labels,
    sample_volume,
    without_padding,
)
from renderer.suggest.opacity_calibration import depths_along
from renderer.suggest.suggestion import LEAST_OPACITY, Suggestion, transparent_between, with_points
from renderer.suggest.turntable_rays import TurntableRays, cast_rays
from renderer.suggest.volume_suggestion import VolumeSuggestion, read_in_colors, suggest_read
from renderer.suggest.wishes import Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Float64, Volume

# The least mean opacity of a step's rays with a look that suits it, as a part of the opacity with the step's own look.
_LEAST_SHOWN = 0.1
# The largest share of the voxels on the border, where the air is, that such a look shows beyond the step's own look.
_MOST_AIR = 0.02
# The opacity of a step that shows next to nothing, as a part of the opacity of the most visible step.
_NEXT_TO_NOTHING = 0.05


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
    """Suggest a look for the steps of a volume whose time may move: one that suits as many of them as possible."""
    all_steps = steps_in_time(volume)
    if len(all_steps) == 1:
        return suggest_read(*_read(volume.at(0), read, wish), wish)
    steps = [_look_at(all_steps[k], read, wish) for k in some_steps(len(all_steps))]
    widest = max(steps, key=lambda step: step.span)
    if widest.found.suggestion.transfer.labels is not None:
        spec, labels, statistics = _read(replace(volume.at(0), time=widest.number), read, wish)
        of_all = volume.map(lambda each: replace(spec, time=each.time))
        known = partial(read_labels, of_all, read, LabelsSpec())
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
    sample = without_padding(sample_volume(volume, shown))
    span, (border, _), empty = sample.maximum - sample.minimum, sample.valid_values(), np.empty((0, 0, 0))
    return _Step(
        number=number,
        found=found,
        span=span,
        rays=cast_rays(sample),
        sample=replace(sample, normalized=empty, neighbours=empty, is_valid=empty > 0),
        border=sample.minimum + span * border,
        background=find_background(sample),
    )


def _most_suitable(steps: Sequence[_Step], widest: _Step) -> tuple[_Step, Suggestion]:
    """Return the step whose look suits most of some steps, and the look; of equal ones the first, of the widest range.

    Steps without a background do not count, for nothing tells the object from its surroundings.
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
